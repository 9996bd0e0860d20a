//! Macro definitions: names, parameters and bodies.

use super::token::{Kind, Token, lex};
use std::collections::HashMap;

/// A macro.
#[derive(Clone, Debug)]
pub(super) struct Macro {
    /// The macro's parameters; `None` if the macro is used without brackets.
    pub parameters: Option<Vec<String>>,
    /// The macro's body, without comments, with single blanks between tokens, and with a [`Kind::Break`] at the
    /// beginning of every line but the first.
    pub body: Vec<Token>,
}

/// The macros that are defined at the current position in the text.
#[derive(Clone, Debug, Default)]
pub(super) struct Macros(HashMap<String, Macro>);

impl Macros {
    pub fn get(&self, name: &str) -> Option<&Macro> {
        self.0.get(name)
    }

    /// Reads the definition in a compiler's `-D` option: `NAME=VALUE`, or only `NAME`, which means `NAME=1`.
    pub fn define_option(&mut self, option: &str) -> Result<(), String> {
        let (name, value) = option.split_once('=').unwrap_or((option, "1"));
        self.define(&lex(&format!("{name} {value}")))
    }

    /// Reads the text after `#define`.
    pub fn define(&mut self, line: &[Token]) -> Result<(), String> {
        let start = line.iter().position(Token::is_code).unwrap_or(line.len());
        let Some((name, rest)) = line[start..].split_first().filter(|(name, _)| name.kind == Kind::Name)
        else {
            return Err("#define needs a name".to_owned());
        };
        let (parameters, body) = match rest.first() {
            Some(bracket) if bracket.is("(") => {
                let (parameters, body) = parameters(&rest[1..]).ok_or_else(|| {
                    format!("the parameters of {} are not names separated by commas", name.text)
                })?;
                (Some(parameters), body)
            }
            _ => (None, rest),
        };
        self.0.insert(name.text.clone(), Macro { parameters, body: laid_out(body) });
        Ok(())
    }

    pub fn undefine(&mut self, name: &str) {
        self.0.remove(name);
    }
}

/// Returns the parameters up to the closing bracket, and the tokens after the bracket. Variable numbers of arguments
/// are not supported.
fn parameters(tokens: &[Token]) -> Option<(Vec<String>, &[Token])> {
    let end = tokens.iter().position(|token| token.is(")"))?;
    let inside: Vec<_> = tokens[..end].iter().filter(|token| token.is_code()).collect();
    let mut names = Vec::new();
    for part in inside.split(|token| token.is(",")).filter(|_| !inside.is_empty()) {
        let [name] = part else { return None };
        names.push((name.kind == Kind::Name).then(|| name.text.clone())?);
    }
    Some((names, &tokens[end + 1..]))
}

/// Returns a body in lines, each with its indentation relative to the others.
fn laid_out(body: &[Token]) -> Vec<Token> {
    let lines: Vec<(usize, Vec<Token>)> = body.split(|token| token.kind == Kind::Break).map(line).collect();
    let first = lines.first().map_or(0, |_| 1);
    let least = lines[first..].iter().filter(|(_, line)| !line.is_empty()).map(|(indent, _)| *indent).min();
    let mut laid_out = Vec::new();
    for (number, (indent, line)) in lines.into_iter().enumerate().filter(|(_, (_, line))| !line.is_empty()) {
        if !laid_out.is_empty() {
            let further = if number == 0 { 0 } else { indent - least.unwrap_or(indent) };
            laid_out.push(Token::new(Kind::Break, " ".repeat(further), line[0].line));
        }
        laid_out.extend(line);
    }
    laid_out
}

/// Returns a line's indentation and its contents, without comments and without blanks at either end. Other runs of
/// blanks become single blanks.
fn line(tokens: &[Token]) -> (usize, Vec<Token>) {
    let indent = tokens.first().filter(|token| token.kind == Kind::Space).map_or(0, |space| space.text.len());
    let mut line: Vec<Token> = Vec::new();
    for token in tokens {
        if token.is_code() {
            line.push(token.clone());
        } else if line.last().is_some_and(Token::is_code) {
            line.push(Token::new(Kind::Space, " ", token.line));
        }
    }
    if line.last().is_some_and(|token| !token.is_code()) {
        line.pop();
    }
    (indent, line)
}
