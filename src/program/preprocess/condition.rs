//! Evaluates the condition of an `#if`, which is an integer expression.

use super::expand::expand;
use super::macros::Macros;
use super::token::{Kind, Token};
use super::value::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Questions that conditions ask about the compiler, such as whether the compiler defines a macro. Contains the answers
/// that raycl knows, and the questions without an answer.
#[derive(Clone, Debug, Default)]
pub(super) struct Compiler {
    /// The compiler's answer to each question. A question is `defined(NAME)`, `__has_builtin(NAME)`, or the name
    /// of a macro whose value a condition uses.
    pub given: BTreeMap<String, Value>,
    /// The questions that neither the text nor `given` answers. The preprocessor takes 0 as the answer to each of
    /// them.
    pub asked: BTreeSet<String>,
}

impl Compiler {
    fn ask(&mut self, question: &str) -> Value {
        if let Some(answer) = self.given.get(question) {
            return *answer;
        }
        self.asked.insert(question.to_owned());
        Value::default()
    }

    /// Returns true if a name is defined in the text or by the compiler. The compiler is not asked for the name's
    /// value: a macro with parameters has none, and other macros need not be numbers.
    pub fn is_defined(&mut self, macros: &Macros, name: &str) -> bool {
        macros.get(name).is_some() || self.ask(&format!("defined({name})")).is_true()
    }
}

/// Returns true if the value of the condition `line` is not 0. Returns a message if the condition is not a
/// valid expression.
pub(super) fn holds(line: &[Token], macros: &Macros, compiler: &mut Compiler) -> Result<bool, String> {
    let asked = answer_questions(line, macros, compiler)?;
    let expanded = expand(macros, asked, true).map_err(|(_, message)| message)?;
    let tokens = expanded.into_iter().filter(Token::is_code).collect();
    let mut parser = Parser { tokens, at: 0, depth: 0, compiler };
    let value = parser.choice(true)?;
    match parser.peek() {
        None => Ok(value.is_true()),
        Some(other) => Err(format!("expected the end of the condition, not '{other}'")),
    }
}

/// Replaces `defined NAME`, `defined(NAME)` and `__has_builtin(NAME)` by 0 or 1, before macros are expanded.
fn answer_questions(line: &[Token], macros: &Macros, compiler: &mut Compiler) -> Result<Vec<Token>, String> {
    let tokens: Vec<_> = line.iter().filter(|token| token.is_code()).collect();
    let mut answered = Vec::new();
    let mut rest = &tokens[..];
    while let [first, after @ ..] = rest {
        let builtin = first.text == "__has_builtin";
        if first.text != "defined" && !builtin {
            answered.push((*first).clone());
            rest = after;
            continue;
        }
        let (name, after) = match after {
            [open, name, close, after @ ..] if open.is("(") && close.is(")") => (name, after),
            [name, after @ ..] if name.kind == Kind::Name && !builtin => (name, after),
            _ => return Err(format!("{} needs a name", first.text)),
        };
        let yes = if builtin {
            compiler.ask(&format!("__has_builtin({})", name.text)).is_true()
        } else {
            compiler.is_defined(macros, &name.text)
        };
        answered.push(Token::new(Kind::Number, u8::from(yes).to_string(), first.line));
        rest = after;
    }
    Ok(answered)
}

/// Binary operators by precedence, lowest first.
const LEVELS: &[&[&str]] = &[
    &["||"],
    &["&&"],
    &["|"],
    &["^"],
    &["&"],
    &["==", "!="],
    &["<", ">", "<=", ">="],
    &["<<", ">>"],
    &["+", "-"],
    &["*", "/", "%"],
];

/// Parses a condition from left to right. The methods' parameter `live` is false for an operand whose value
/// does not matter, such as the right operand of `0 &&`. If an operand's value does not matter, a division by
/// zero in this operand is not an error.
struct Parser<'a> {
    tokens: Vec<Token>,
    at: usize,
    /// The number of nested `?:` operators, unary operators and brackets around the current token.
    depth: usize,
    compiler: &'a mut Compiler,
}

/// The largest depth to which `?:` operators, unary operators and brackets may be nested. The parser is
/// recursive, so each level takes space on the thread's stack.
const MOST_NESTED: usize = 100;

impl Parser<'_> {
    /// Calls `parse` for an operand or a bracket that is nested one level deeper. Returns a message if the
    /// nesting is too deep.
    fn nested(&mut self, parse: impl FnOnce(&mut Self) -> Result<Value, String>) -> Result<Value, String> {
        if self.depth == MOST_NESTED {
            return Err(format!(
                "the condition has brackets, unary operators or ?: nested more than {MOST_NESTED} levels deep"
            ));
        }
        self.depth += 1;
        let value = parse(self);
        self.depth -= 1;
        value
    }

    fn peek(&self) -> Option<&str> {
        self.tokens.get(self.at).map(|token| token.text.as_str())
    }

    fn next_is(&mut self, symbol: &str) -> bool {
        let matches = self.peek() == Some(symbol);
        self.at += usize::from(matches);
        matches
    }

    fn expect(&mut self, symbol: &str) -> Result<(), String> {
        if self.next_is(symbol) {
            return Ok(());
        }
        let next = self.peek().map_or("its end".to_owned(), |next| format!("'{next}'"));
        Err(format!("the condition needs '{symbol}' before {next}"))
    }

    /// Parses `a ? b : c`, or an expression of higher precedence.
    fn choice(&mut self, live: bool) -> Result<Value, String> {
        let condition = self.binary(0, live)?;
        if !self.next_is("?") {
            return Ok(condition);
        }
        let yes = self.nested(|inner| inner.choice(live && condition.is_true()))?;
        self.expect(":")?;
        let no = self.nested(|inner| inner.choice(live && !condition.is_true()))?;
        Ok(if condition.is_true() { yes.beside(no) } else { no.beside(yes) })
    }

    fn binary(&mut self, level: usize, live: bool) -> Result<Value, String> {
        let Some(operators) = LEVELS.get(level) else { return self.unary(live) };
        let mut left = self.binary(level + 1, live)?;
        while let Some(operator) = operators.iter().find(|symbol| self.peek() == Some(**symbol)) {
            self.at += 1;
            let decided = matches!((*operator, left.is_true()), ("||", true) | ("&&", false));
            let right = self.binary(level + 1, live && !decided)?;
            left = apply(operator, left, right, live)?;
        }
        Ok(left)
    }

    fn unary(&mut self, live: bool) -> Result<Value, String> {
        let operators = ["!", "-", "+", "~", "("];
        let Some(operator) = operators.into_iter().find(|symbol| self.next_is(symbol)) else {
            return self.atom();
        };
        if operator == "(" {
            let value = self.nested(|inner| inner.choice(live))?;
            self.expect(")")?;
            return Ok(value);
        }
        Ok(self.nested(|inner| inner.unary(live))?.after(operator))
    }

    /// Parses a number or a name. The value of a name that the compiler does not define is 0.
    fn atom(&mut self) -> Result<Value, String> {
        let Some(token) = self.tokens.get(self.at) else {
            return Err("a value is missing at the condition's end".to_owned());
        };
        self.at += 1;
        match token.kind {
            Kind::Number => {
                Value::of_number(&token.text).ok_or_else(|| format!("'{}' is not an integer", token.text))
            }
            Kind::Name => Ok(self.compiler.ask(&token.text)),
            _ => Err(format!("a value is missing before '{}' in the condition", token.text)),
        }
    }
}

/// Returns the value of a binary operator. An operand whose value does not matter may divide by zero.
fn apply(operator: &str, left: Value, right: Value, live: bool) -> Result<Value, String> {
    let value = left.then(operator, right).or((!live).then_some(left.beside(right)));
    value.ok_or_else(|| "the condition divides by zero".to_owned())
}
