//! Formats lines that macros changed: one statement per line, and long lines broken.

use super::token::{Kind, Token, words_of_pragma};
use std::collections::VecDeque;

/// Lines with more characters than this number are broken if possible.
const WIDEST: usize = 120;
/// If the contents of a round bracket begin at this column or further left, the next lines of the contents begin
/// at the column where the contents begin. Otherwise, the next lines of the contents are indented by four
/// columns more than the statement.
const FURTHEST: usize = 80;

/// Joins a line with the following lines until all round brackets are closed. Macros have shifted the
/// brackets in the line `line`, so the following lines are no longer aligned with these brackets. `line` is
/// returned unchanged if one of the joined lines ends in a `//` comment before all brackets are closed, or if
/// the brackets are never closed.
pub(super) fn whole_brackets(line: &[Token], after: &mut VecDeque<&[Token]>) -> Vec<Token> {
    let mut whole = line.to_vec();
    let mut taken = 0;
    while open_brackets(&whole) > 0 && !ends_in_comment(&whole) {
        let Some(next) = after.get(taken) else { break };
        whole.push(Token::new(Kind::Space, " ", 0));
        whole.extend(next.iter().skip_while(|token| token.kind == Kind::Space).cloned());
        taken += 1;
    }
    if open_brackets(&whole) > 0 {
        return line.to_vec();
    }
    after.drain(..taken);
    whole
}

fn ends_in_comment(line: &[Token]) -> bool {
    line.last().is_some_and(Token::is_line_comment)
}

fn open_brackets(line: &[Token]) -> i32 {
    line.iter().map(|token| i32::from(token.is("(")) - i32::from(token.is(")"))).sum()
}

/// Formats a line that macro expansion changed, and returns the lines that replace it.
pub(super) fn broken(line: Vec<Token>) -> Vec<String> {
    let indent = match line.iter().find(|token| token.kind != Kind::Nothing) {
        Some(first) if first.kind == Kind::Space => first.text.clone(),
        _ => String::new(),
    };
    let statements = statements(tidied(&line));
    statements.into_iter().flat_map(|statement| fitted(&indent, statement)).collect()
}

/// Replaces each run of blanks by one blank. Removes blanks at the start, and before closing round brackets,
/// commas and semicolons.
fn tidied(tokens: &[Token]) -> Vec<Token> {
    let mut tidied: Vec<Token> = Vec::new();
    for token in tokens.iter().filter(|token| token.kind != Kind::Nothing) {
        let parts = [")", ",", ";"].into_iter().any(|symbol| token.is(symbol));
        let blank = token.kind == Kind::Space;
        if (blank || parts) && tidied.last().is_some_and(|last| last.kind == Kind::Space) {
            tidied.pop();
        }
        match blank {
            true if tidied.is_empty() => {}
            true => tidied.push(Token { text: " ".to_owned(), ..token.clone() }),
            false => tidied.push(token.clone()),
        }
    }
    tidied
}

/// Splits the tokens into statements, at semicolons outside brackets. A pragma becomes a statement of its
/// own.
fn statements(tokens: Vec<Token>) -> Vec<Vec<Token>> {
    let mut statements = vec![Vec::new()];
    let mut depth = 0;
    let mut rest = &tokens[..];
    while let [token, after @ ..] = rest {
        rest = after;
        if token.text == "_Pragma"
            && let Some((string, after)) = string_of_pragma(after)
        {
            let text = format!("#pragma {}", words_of_pragma(&string.text));
            statements.extend([vec![Token::new(Kind::Symbol, text, token.line)], Vec::new()]);
            rest = after;
            continue;
        }
        depth += nesting(token);
        let ends = depth == 0 && token.is(";") && after.iter().any(Token::is_code);
        if let Some(statement) = statements.last_mut() {
            statement.push(token.clone());
        }
        if ends {
            statements.push(Vec::new());
        }
    }
    statements.into_iter().map(trimmed).filter(|statement| !statement.is_empty()).collect()
}

/// Returns the string in round brackets after the word `_Pragma`, and the tokens after the brackets. Blanks
/// may separate the word `_Pragma`, the brackets and the string.
fn string_of_pragma(after: &[Token]) -> Option<(&Token, &[Token])> {
    let mut code = after.iter().enumerate().filter(|(_, token)| token.is_code());
    let (_, (_, string), (closing, _)) = (code.next()?, code.next()?, code.next()?);
    Some((string, &after[closing + 1..]))
}

fn nesting(token: &Token) -> i32 {
    match token.text.as_str() {
        "(" | "{" => 1,
        ")" | "}" => -1,
        _ => 0,
    }
}

fn trimmed(mut tokens: Vec<Token>) -> Vec<Token> {
    while tokens.last().is_some_and(|last| last.kind == Kind::Space) {
        tokens.pop();
    }
    tokens.into_iter().skip_while(|token| token.kind == Kind::Space).collect()
}

fn length(tokens: &[Token]) -> usize {
    tokens.iter().map(|token| token.text.chars().count()).sum()
}

/// Breaks a statement into as many lines as necessary, so that no line is too long. A line stays too long if it
/// may not be broken at any position within its first [`WIDEST`] columns.
fn fitted(indent: &str, statement: Vec<Token>) -> Vec<String> {
    let is_long = indent.chars().count() + length(&statement) > WIDEST;
    let brace = statement.iter().position(|token| token.is("{"));
    let holds = |brace: &usize| {
        let closed = statement.last().is_some_and(|last| last.is("}"));
        closed && statement[brace + 1..].iter().filter(|token| token.is_code()).count() > 1
    };
    match brace.filter(|brace| is_long && holds(brace)) {
        Some(brace) => body_apart(indent, statement, brace),
        None => continued(indent, statement),
    }
}

/// Returns the lines of a statement with braces: `head {`, then the contents of the braces, then `}`.
fn body_apart(indent: &str, mut head: Vec<Token>, brace: usize) -> Vec<String> {
    let mut body = head.split_off(brace + 1);
    body.pop();
    let inner = format!("{indent}    ");
    let mut lines = continued(indent, head);
    lines.extend(statements(body).into_iter().flat_map(|statement| fitted(&inner, statement)));
    lines.push(format!("{indent}}}"));
    lines
}

/// Returns the lines of a statement, broken where a line would be too long.
fn continued(indent: &str, statement: Vec<Token>) -> Vec<String> {
    let (mut lines, mut margin, mut open) = (Vec::new(), indent.chars().count(), Vec::new());
    let mut rest = statement;
    let further = margin + 4;
    while let Some(line_break) = next_break(&rest, margin, open.clone(), further) {
        let after = rest.split_off(line_break.at);
        lines.push(spelled(margin, &rest));
        rest = trimmed(after);
        margin = line_break.column;
        open = vec![margin; line_break.depth];
    }
    lines.push(spelled(margin, &rest));
    lines
}

fn spelled(margin: usize, tokens: &[Token]) -> String {
    let text: String = tokens.iter().map(|token| token.text.as_str()).collect();
    format!("{}{}", " ".repeat(margin), text.trim_end())
}

/// A line break: the index of the first token after the break, the column where the next line starts, and the
/// number of open round brackets.
struct LineBreak {
    at: usize,
    column: usize,
    depth: usize,
}

/// Returns where to break a line. Considers all positions where a break is allowed and the text before the break is not
/// too long. Of the positions that are inside the fewest brackets, returns the last one. Returns `None` if the whole
/// line fits, or if there is no such position. `open` has an element for each bracket that was opened on an earlier
/// line and is still open: the column at which the next lines of the bracket's contents begin. `further` is the column
/// at which the next line starts if no bracket is open at the break, or if the contents of the innermost open bracket
/// begin further right than [`FURTHEST`].
fn next_break(tokens: &[Token], margin: usize, mut open: Vec<usize>, further: usize) -> Option<LineBreak> {
    if margin + length(tokens) <= WIDEST {
        return None;
    }
    let (mut column, mut best) = (margin, None::<LineBreak>);
    for (at, token) in tokens.iter().enumerate() {
        column += token.text.chars().count();
        if column > WIDEST + 1 {
            break;
        }
        let depth = open.len();
        if may_break(tokens, at, depth) && best.as_ref().is_none_or(|best| depth <= best.depth) {
            let beside = open.last().copied().filter(|column| *column <= FURTHEST);
            best = Some(LineBreak { at: at + 1, column: beside.unwrap_or(further), depth });
        }
        match token.text.as_str() {
            "(" => open.push(column),
            ")" => drop(open.pop()),
            _ => {}
        }
    }
    best
}

/// Returns true if a line may be broken at the token `at`. The token must be a blank that follows a comma, precedes an
/// operator such as `&&` or `+`, or lies between a closing round bracket and a name, as before the body of a loop. A
/// blank between a bracket and a name must be outside all brackets (`depth` is 0).
fn may_break(tokens: &[Token], at: usize, depth: usize) -> bool {
    if at == 0 || at + 1 >= tokens.len() || tokens[at].kind != Kind::Space {
        return false;
    }
    let (before, after) = (&tokens[at - 1], &tokens[at + 1]);
    let joins = ["&&", "||", "?", ":", "&", "+", "-"].iter().any(|symbol| after.is(symbol));
    let repeated = depth == 0 && before.is(")") && after.kind == Kind::Name;
    before.is(",") || joins || repeated
}
