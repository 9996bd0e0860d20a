//! Evaluates the condition of an `#if`, which is an integer expression.

use super::expand::expand;
use super::macros::Macros;
use super::token::{Kind, Token};
use std::collections::{BTreeMap, BTreeSet};

/// The compiler's macros that raycl knows, and the unknown macros that conditions use.
#[derive(Clone, Debug, Default)]
pub(super) struct Compiler {
    /// The values of the compiler's macros and of `__has_builtin(NAME)`. A key of the map is a macro's name,
    /// or a whole text such as `__has_builtin(f)`.
    pub given: BTreeMap<String, i64>,
    /// Names that conditions use, but that neither the text nor `given` defines. The preprocessor treats the
    /// names in `asked` as undefined.
    pub asked: BTreeSet<String>,
}

impl Compiler {
    fn ask(&mut self, name: &str) -> Option<i64> {
        let known = self.given.get(name).copied();
        if known.is_none() {
            self.asked.insert(name.to_owned());
        }
        known
    }

    /// Returns true if a name is defined in the text or by the compiler.
    pub fn is_defined(&mut self, macros: &Macros, name: &str) -> bool {
        macros.get(name).is_some() || self.ask(name).is_some()
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
        None => Ok(value != 0),
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
            compiler.ask(&format!("__has_builtin({})", name.text)).is_some_and(|value| value != 0)
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
    fn nested(&mut self, parse: impl FnOnce(&mut Self) -> Result<i64, String>) -> Result<i64, String> {
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
    fn choice(&mut self, live: bool) -> Result<i64, String> {
        let condition = self.binary(0, live)?;
        if !self.next_is("?") {
            return Ok(condition);
        }
        let yes = self.nested(|inner| inner.choice(live && condition != 0))?;
        self.expect(":")?;
        let no = self.nested(|inner| inner.choice(live && condition == 0))?;
        Ok(if condition != 0 { yes } else { no })
    }

    fn binary(&mut self, level: usize, live: bool) -> Result<i64, String> {
        let Some(operators) = LEVELS.get(level) else { return self.unary(live) };
        let mut left = self.binary(level + 1, live)?;
        while let Some(operator) = operators.iter().find(|symbol| self.peek() == Some(**symbol)) {
            self.at += 1;
            let decided = matches!((*operator, left != 0), ("||", true) | ("&&", false));
            let right = self.binary(level + 1, live && !decided)?;
            left = apply(operator, left, right, live)?;
        }
        Ok(left)
    }

    fn unary(&mut self, live: bool) -> Result<i64, String> {
        let operators = ["!", "-", "+", "~", "("];
        let Some(operator) = operators.into_iter().find(|symbol| self.next_is(symbol)) else {
            return self.atom();
        };
        if operator == "(" {
            let value = self.nested(|inner| inner.choice(live))?;
            self.expect(")")?;
            return Ok(value);
        }
        let value = self.nested(|inner| inner.unary(live))?;
        Ok(match operator {
            "!" => i64::from(value == 0),
            "-" => value.wrapping_neg(),
            "~" => !value,
            _ => value,
        })
    }

    /// Parses a number or a name. The value of a name that the compiler does not define is 0.
    fn atom(&mut self) -> Result<i64, String> {
        let Some(token) = self.tokens.get(self.at) else {
            return Err("a value is missing at the condition's end".to_owned());
        };
        self.at += 1;
        match token.kind {
            Kind::Number => number(&token.text).ok_or_else(|| format!("'{}' is not an integer", token.text)),
            Kind::Name => Ok(self.compiler.ask(&token.text).unwrap_or(0)),
            _ => Err(format!("a value is missing before '{}' in the condition", token.text)),
        }
    }
}

fn apply(operator: &str, left: i64, right: i64, live: bool) -> Result<i64, String> {
    let by_zero = matches!(operator, "/" | "%") && right == 0;
    if by_zero && live {
        return Err("the condition divides by zero".to_owned());
    }
    Ok(match operator {
        _ if by_zero => 0,
        "||" => i64::from(left != 0 || right != 0),
        "&&" => i64::from(left != 0 && right != 0),
        "|" => left | right,
        "^" => left ^ right,
        "&" => left & right,
        "==" => i64::from(left == right),
        "!=" => i64::from(left != right),
        "<" => i64::from(left < right),
        ">" => i64::from(left > right),
        "<=" => i64::from(left <= right),
        ">=" => i64::from(left >= right),
        "<<" => left.wrapping_shl(right as u32),
        ">>" => left.wrapping_shr(right as u32),
        "+" => left.wrapping_add(right),
        "-" => left.wrapping_sub(right),
        "*" => left.wrapping_mul(right),
        "/" => left.wrapping_div(right),
        _ => left.wrapping_rem(right),
    })
}

/// Parses a decimal, hexadecimal or octal integer with C's suffixes; `None` for any other text.
fn number(text: &str) -> Option<i64> {
    let digits = text.trim_end_matches(['u', 'U', 'l', 'L']);
    if let Some(hexadecimal) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        return i64::from_str_radix(hexadecimal, 16).ok();
    }
    match digits.strip_prefix('0') {
        Some(octal) if !octal.is_empty() => i64::from_str_radix(octal, 8).ok(),
        _ => digits.parse().ok(),
    }
}
