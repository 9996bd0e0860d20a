//! Replaces the parameters in a macro's body by arguments. `#` makes a string of an argument, `##` joins two
//! tokens.

use super::expand::{Misuse, expand};
use super::macros::{Macro, Macros};
use super::token::{Kind, Token, code};

/// Returns the body of the macro `name` for a call with these arguments. The line number in an error refers
/// to the macro's definition or to an argument, or is 0. The caller replaces the line number in the error by
/// the line number of the call.
pub(super) fn substitute(
    macros: &Macros,
    name: &str,
    called: &Macro,
    parameters: &[String],
    arguments: &[Vec<Token>],
) -> Result<Vec<Token>, Misuse> {
    let body = &called.body;
    let argument = |token: &Token| {
        let named = |name: &String| token.kind == Kind::Name && *name == token.text;
        parameters.iter().position(named).map(|at| &arguments[at])
    };
    let mut made: Vec<Token> = Vec::new();
    let mut at = 0;
    while let Some(token) = body.get(at) {
        at += 1;
        let next = at + body[at..].iter().take_while(|token| !token.is_code()).count();
        let string = body.get(next).filter(|_| token.is("#")).and_then(argument);
        if let Some(argument) = string {
            made.push(Token::new(Kind::Literal, spelled(argument), token.line));
            at = next + 1;
        } else if token.is("##") && next < body.len() {
            let right = argument(&body[next])
                .map_or_else(|| vec![body[next].clone()], |argument| as_spelled(argument));
            join(&mut made, right).map_err(|(line, message)| (line, format!("{name}: {message}")))?;
            at = next + 1;
        } else if let Some(argument) = argument(token) {
            let joins = body.get(next).is_some_and(|next| next.is("##"));
            made.extend(if joins { as_spelled(argument) } else { expand(macros, argument.clone(), true)? });
        } else {
            made.push(token.clone());
        }
    }
    Ok(made)
}

/// Returns an argument as spelled, without comments and without blanks at either end. No blank replaces a
/// removed comment; tokens that would merge are separated later. For an empty argument, returns a placeholder
/// token, which the operator `##` replaces by its other operand.
fn as_spelled(argument: &[Token]) -> Vec<Token> {
    let mut spelled: Vec<Token> = argument
        .iter()
        .filter(|token| token.kind != Kind::Comment)
        .skip_while(|token| token.kind == Kind::Space)
        .cloned()
        .collect();
    while spelled.last().is_some_and(|last| last.kind == Kind::Space) {
        spelled.pop();
    }
    if spelled.is_empty() { vec![Token::new(Kind::Nothing, "", 0)] } else { spelled }
}

/// Joins the last token of `made` with the first token of `right`. Returns an error if the joined text is not
/// a single token.
fn join(made: &mut Vec<Token>, right: Vec<Token>) -> Result<(), Misuse> {
    while made.last().is_some_and(|last| last.kind == Kind::Space) {
        made.pop();
    }
    let Some(left) = made.pop() else { return Err((0, "the operator ## has nothing before it".to_owned())) };
    let mut right = right.into_iter();
    let Some(first) = right.next() else {
        made.push(left);
        return Ok(());
    };
    let text = format!("{}{}", left.text, first.text);
    match &code(&text)[..] {
        [] => made.push(left),
        [one] if one.text == text => made.push(Token { kind: one.kind, text, ..left }),
        _ => return Err((first.line, format!("{} ## {} is not one token", left.text, first.text))),
    }
    made.extend(right);
    Ok(())
}

/// Returns an argument as a C string literal, for the operator `#`. Blanks and comments between two tokens
/// become one blank.
fn spelled(argument: &[Token]) -> String {
    let (mut text, mut is_apart) = (String::new(), false);
    for token in argument.iter().filter(|token| token.kind != Kind::Nothing) {
        if !token.is_code() {
            is_apart = true;
            continue;
        }
        if is_apart && !text.is_empty() {
            text.push(' ');
        }
        is_apart = false;
        let literal = token.kind == Kind::Literal;
        text +=
            &if literal { token.text.replace('\\', "\\\\").replace('"', "\\\"") } else { token.text.clone() };
    }
    format!("\"{text}\"")
}
