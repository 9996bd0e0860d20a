//! Expands macro calls as in C99 6.10.3: arguments are expanded first, the result is scanned again, and no
//! macro is expanded within its own expansion. To find out whether a call lies within the macro's own expansion, each
//! token has a list of the macros from which the token came (Prosser's algorithm).

use super::macros::{Macro, Macros};
use super::substitute::substitute;
use super::token::{Kind, Token, lex};
use crate::words::counted;
use std::collections::VecDeque;

/// A mistake in a macro call: the number of the call's line in the whole text, and a message.
pub(super) type Misuse = (u32, String);
/// The arguments of a macro call, and the call's closing bracket.
type Arguments = (Vec<Vec<Token>>, Token);

/// Expands every macro call in a piece of text. If `inline` is true, the lines of a macro's body become one
/// line.
pub(super) fn expand(macros: &Macros, text: Vec<Token>, inline: bool) -> Result<Vec<Token>, Misuse> {
    let depth = usize::from(inline);
    let line = text.first().map_or(0, |token| token.line);
    let mut expander = Expander { macros, input: text.into(), output: Vec::new(), depth };
    macros.nested(line, || expander.run())?;
    Ok(expander.output)
}

struct Expander<'a> {
    macros: &'a Macros,
    input: VecDeque<Token>,
    output: Vec<Token>,
    /// Number of open round brackets in the output. Within brackets, the line breaks of a macro's body become
    /// blanks. If the whole expansion of a macro is to be in one line, `depth` starts at 1 instead of 0, as if
    /// within brackets.
    depth: usize,
}

impl Expander<'_> {
    /// Moves all tokens of the input to the output, and expands the macro calls among these tokens.
    fn run(&mut self) -> Result<(), Misuse> {
        while let Some(token) = self.input.pop_front() {
            self.take(token)?;
        }
        Ok(())
    }

    /// Adds a token to the output or, if the token begins a macro call, puts the call's expansion at the
    /// front of the input.
    fn take(&mut self, token: Token) -> Result<(), Misuse> {
        let callable = token.kind == Kind::Name && !token.hidden.contains(&token.text);
        let Some(called) = self.macros.get(&token.text).filter(|_| callable) else {
            self.push(token);
            return Ok(());
        };
        let Some(parameters) = &called.parameters else { return self.replace(token, called, &[], &[]) };
        let Some((arguments, closing)) = self.arguments(&token)? else {
            self.push(token);
            return Ok(());
        };
        if arguments.len() != parameters.len().max(1) {
            let (wanted, got) = (parameters.len(), arguments.len());
            return Err((
                token.line,
                format!("{} takes {}, not {got}", token.text, counted(wanted, "argument")),
            ));
        }
        let mut call = token;
        // The name and the closing bracket of a call may come from different macros. If both came from the
        // same macro, the call's expansion must not call this macro again.
        call.hidden.retain(|name| closing.hidden.contains(name));
        self.replace(call, called, parameters, &arguments)
    }

    /// Puts the expansion of a call at the front of the input, except in two cases. If the macro is a
    /// constant, the constant is added to the output, followed by the macro's name in a comment. If the
    /// expansion is empty, only a mark is added to the output.
    fn replace(
        &mut self,
        call: Token,
        called: &Macro,
        parameters: &[String],
        arguments: &[Vec<Token>],
    ) -> Result<(), Misuse> {
        let made = |kind, text: &str| Token { made: true, ..Token::new(kind, text, call.line) };
        let hidden = [&call.hidden[..], std::slice::from_ref(&call.text)].concat();
        if let Some(constant) = self.constant(called, &hidden) {
            constant.iter().for_each(|token| self.push(made(token.kind, &token.text)));
            self.push(made(Kind::Space, " "));
            self.push(made(Kind::Comment, &format!("/* {} */", call.text)));
            return Ok(());
        }
        let body = substitute(self.macros, &call.text, called, parameters, arguments)
            .map_err(|(_, message)| (call.line, message))?;
        self.macros.count(body.len() + hidden.len()).map_err(|message| (call.line, message))?;
        if !body.iter().any(Token::is_code) {
            self.push(made(Kind::Nothing, ""));
            self.skip_space();
            return Ok(());
        }
        for mut token in body.into_iter().flat_map(self.placed()).collect::<Vec<_>>().into_iter().rev() {
            (token.line, token.made) = (call.line, true);
            token.hidden.extend(hidden.iter().cloned());
            self.input.push_front(token);
        }
        Ok(())
    }

    /// Returns the expanded body of a macro without parameters if the macro is a constant, that is, if this body
    /// consists of at least one number and perhaps operators, and of nothing else. Otherwise, returns `None` and
    /// remembers that the macro is not a constant. Also returns `None` if the macro has parameters.
    fn constant(&self, called: &Macro, hidden: &[String]) -> Option<Vec<Token>> {
        let name =
            hidden.last().filter(|name| called.parameters.is_none() && self.macros.may_be_constant(name))?;
        let constant = self.expanded_constant(called, hidden);
        if constant.is_none() {
            self.macros.is_not_constant(name);
        }
        constant
    }

    /// Returns the expanded body of a macro without parameters, like `constant`, but remembers nothing about
    /// the macro.
    fn expanded_constant(&self, called: &Macro, hidden: &[String]) -> Option<Vec<Token>> {
        let mut body = called.body.clone();
        body.iter_mut().for_each(|token| token.hidden = hidden.to_vec());
        let expanded = expand(self.macros, body, true).ok()?;
        let plain = trimmed(expanded.into_iter().filter(|token| token.kind != Kind::Comment).collect());
        let is_number = |token: &Token| token.kind == Kind::Number;
        let operators = |token: &Token| ![",", ";", "{", "}"].contains(&token.text.as_str());
        let fits = |token: &Token| is_number(token) || (token.kind == Kind::Symbol && operators(token));
        let mut code = plain.iter().filter(|token| token.is_code());
        (code.all(fits) && plain.iter().any(is_number)).then_some(plain)
    }

    /// Returns a function that replaces a line break of a macro's body, and returns any other token
    /// unchanged. Within brackets, a line break becomes a blank. Outside brackets, a line break becomes a
    /// line end, and the indentation of the output's last line is put before the new line's own indentation.
    fn placed(&self) -> impl Fn(Token) -> Vec<Token> {
        let indentation = (self.depth == 0).then(|| self.indentation());
        move |token| match &indentation {
            _ if token.kind != Kind::Break => vec![token],
            None => vec![Token::new(Kind::Space, " ", token.line)],
            Some(indentation) => {
                let further = format!("{indentation}{}", token.text);
                vec![
                    Token::new(Kind::NewLine, "\n", token.line),
                    Token::new(Kind::Space, further, token.line),
                ]
            }
        }
    }

    /// Removes the blank after an empty expansion if a blank or the beginning of a line precedes the expansion.
    fn skip_space(&mut self) {
        let before = self.output.iter().rev().find(|token| token.kind != Kind::Nothing);
        let spaced = before.is_none_or(|token| matches!(token.kind, Kind::Space | Kind::NewLine));
        if spaced && self.input.front().is_some_and(|token| token.kind == Kind::Space) {
            self.input.pop_front();
        }
    }

    /// Adds a token to the output. If a compiler would read this token and the previous token differently
    /// without a space between them, adds a blank first.
    fn push(&mut self, token: Token) {
        if token.is("(") {
            self.depth += 1;
        } else if token.is(")") {
            self.depth = self.depth.saturating_sub(1);
        }
        let before = self.output.iter().rev().find(|before| before.kind != Kind::Nothing);
        let changed = token.made || self.output.last().is_some_and(|before| before.made);
        if changed && before.is_some_and(|before| glued(before, &token)) {
            self.output.push(Token { made: true, ..Token::new(Kind::Space, " ", token.line) });
        }
        self.output.push(token);
    }

    /// Returns the blanks at the beginning of the output's last line.
    fn indentation(&self) -> String {
        let start = self.output.iter().rposition(|token| token.kind == Kind::NewLine).map_or(0, |at| at + 1);
        let first = self.output[start..].iter().find(|token| token.kind != Kind::Nothing);
        first.filter(|token| token.kind == Kind::Space).map_or_else(String::new, |space| space.text.clone())
    }

    /// Takes the arguments of a macro call from the input; `None` if no opening bracket follows the macro's
    /// name.
    fn arguments(&mut self, call: &Token) -> Result<Option<Arguments>, Misuse> {
        let Some(open) = self.input.iter().position(Token::is_code) else { return Ok(None) };
        if !self.input[open].is("(") {
            return Ok(None);
        }
        self.input.drain(..=open);
        let (mut arguments, mut depth) = (vec![Vec::new()], 0);
        while let Some(token) = self.input.pop_front() {
            match token.text.as_str() {
                ")" if depth == 0 => return Ok(Some((arguments.into_iter().map(trimmed).collect(), token))),
                "," if depth == 0 => {
                    arguments.push(Vec::new());
                    continue;
                }
                "(" => depth += 1,
                ")" => depth -= 1,
                _ => {}
            }
            if let Some(argument) = arguments.last_mut() {
                argument.push(in_one_line(token));
            }
        }
        Err((
            call.line,
            format!("the call of {} is not closed before the next directive or the file's end", call.text),
        ))
    }
}

/// Returns true if a compiler would read two adjacent tokens differently without a space between them.
fn glued(before: &Token, after: &Token) -> bool {
    if !before.is_code() || !after.is_code() {
        return false;
    }
    let together = format!("{}{}", before.text, after.text);
    lex(&together).first().is_none_or(|first| first.text != before.text)
}

/// Returns a blank if the token is a line end or a comment that ends with its line; otherwise returns the
/// token unchanged.
fn in_one_line(token: Token) -> Token {
    let ends = matches!(token.kind, Kind::NewLine | Kind::Break) || token.is_line_comment();
    if ends { Token { kind: Kind::Space, text: " ".to_owned(), ..token } } else { token }
}

/// Removes the blanks at both ends, and replaces every other run of blanks by a single blank.
fn trimmed(tokens: Vec<Token>) -> Vec<Token> {
    let mut remaining: Vec<Token> = Vec::new();
    for mut token in tokens {
        let blank = token.kind == Kind::Space;
        if blank && remaining.last().is_none_or(|last| last.kind == Kind::Space) {
            continue;
        }
        if blank {
            token.text = " ".to_owned();
        }
        remaining.push(token);
    }
    if remaining.last().is_some_and(|last| last.kind == Kind::Space) {
        remaining.pop();
    }
    remaining
}
