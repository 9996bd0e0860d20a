//! Macro definitions: names, parameters and bodies.

use super::expand::Misuse;
use super::token::{Kind, Token, lex};
use std::cell::{Cell, RefCell};
use std::collections::{HashMap, HashSet};

#[derive(Clone, Debug)]
pub(super) struct Macro {
    /// The macro's parameters; `None` if the macro is object-like, that is, used without brackets.
    pub parameters: Option<Vec<String>>,
    /// The macro's body, without comments, with a single blank in place of each run of blanks, and with a
    /// [`Kind::Break`] at the beginning of every line except the first.
    pub body: Vec<Token>,
}

/// The largest number of tokens that all macro expansions of a program together may make. The program with
/// the most expansions in `cl/` makes some thousands of tokens. For each expansion, raycl stores a list of the
/// macros from which the expansion came; all its tokens share this list. An expansion counts as the number of
/// its tokens plus the number of macros in the list.
const MOST_TOKENS: usize = 500_000;
/// The largest depth to which macro expansions may be nested. Each nested expansion takes space on the
/// thread's stack.
const MOST_NESTED: usize = 100;

/// The macros that are defined at the current position in the text.
#[derive(Clone, Debug, Default)]
pub(super) struct Macros {
    defined: HashMap<String, Macro>,
    /// The names of macros without parameters that are known not to be constants. A constant expands to at least
    /// one number and perhaps operators, and to nothing else. Without this set of names, the time to expand a
    /// chain of macros, in which each macro uses the next, would double with every macro of the chain.
    not_constant: RefCell<HashSet<String>>,
    /// The number of tokens that macro expansions have made so far.
    made: Cell<usize>,
    /// The number of expansions that have begun and not ended.
    nested: Cell<usize>,
}

impl Macros {
    pub fn get(&self, name: &str) -> Option<&Macro> {
        self.defined.get(name)
    }

    /// Returns `false` if the macro of this name is known not to be a constant.
    pub fn may_be_constant(&self, name: &str) -> bool {
        !self.not_constant.borrow().contains(name)
    }

    /// Remembers that the macro of this name is not a constant.
    pub fn is_not_constant(&self, name: &str) {
        self.not_constant.borrow_mut().insert(name.to_owned());
    }

    /// Counts tokens that an expansion makes. Returns an error if expansions make too many tokens. Even a
    /// short text can exceed the limit: a few lines can define macros that double a text any number of times.
    pub fn count(&self, tokens: usize) -> Result<(), String> {
        self.made.set(self.made.get() + tokens);
        let fits = self.made.get() <= MOST_TOKENS;
        fits.then_some(()).ok_or_else(|| format!("macros expand to more than {MOST_TOKENS} tokens"))
    }

    /// Calls `expand`, which expands the macros of a text and may call `nested` again. Returns an error with
    /// the line number `line` if the calls of `nested` are nested too deeply.
    pub fn nested(&self, line: u32, expand: impl FnOnce() -> Result<(), Misuse>) -> Result<(), Misuse> {
        let depth = self.nested.get();
        if depth == MOST_NESTED {
            return Err((line, format!("macro calls are nested more than {MOST_NESTED} levels deep")));
        }
        self.nested.set(depth + 1);
        let expanded = expand();
        self.nested.set(depth);
        expanded
    }

    /// Reads the definition in a compiler's `-D` option: `NAME=VALUE`, or only `NAME`, which means `NAME=1`.
    pub fn define_option(&mut self, option: &str) -> Result<(), String> {
        let (name, value) = option.split_once('=').unwrap_or((option, "1"));
        self.define(&lex(&format!("{name} {value}")))
    }

    /// Defines or redefines a macro from the text after `#define`. Returns a message if the text is not a
    /// macro definition.
    pub fn define(&mut self, line: &[Token]) -> Result<(), String> {
        let start = line.iter().position(Token::is_code).unwrap_or(line.len());
        let Some((name, rest)) = line[start..].split_first().filter(|(name, _)| name.kind == Kind::Name)
        else {
            return Err("#define needs a name".to_owned());
        };
        let (parameters, body) = match rest.first() {
            Some(bracket) if bracket.is("(") => {
                let (parameters, body) = parameters(&rest[1..]).ok_or_else(|| {
                    let expected = "expected names separated by commas, and then `)`";
                    format!("the parameters of {} are not valid; {expected}", name.text)
                })?;
                (Some(parameters), body)
            }
            _ => (None, rest),
        };
        self.not_constant.get_mut().clear();
        self.defined.insert(name.text.clone(), Macro { parameters, body: laid_out(body) });
        Ok(())
    }

    pub fn undefine(&mut self, name: &str) {
        self.not_constant.get_mut().clear();
        self.defined.remove(name);
    }
}

/// Returns a macro's parameters up to the closing bracket, and the tokens after the bracket. Returns `None`
/// if the bracket is not closed, or if it contains anything except names and commas, such as the `...` of a
/// variable number of arguments.
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

/// Returns a macro's body in lines. Before each line except the first is a [`Kind::Break`], whose text is the
/// line's indentation, minus the smallest indentation of all lines after the first.
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

/// Returns a line's indentation and its contents, without comments and without blanks at either end. Each run
/// of blanks within the line becomes a single blank.
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
