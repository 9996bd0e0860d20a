//! The values of conditions, with C's rules for signed and unsigned integers of 64 bits (`intmax_t` and
//! `uintmax_t`).

/// The value of an integer expression in a condition; 0 by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Value {
    /// The bits of the value; a negative value is stored in two's complement.
    pub bits: u64,
    /// True if the value is of an unsigned type, so that it is never negative.
    pub is_unsigned: bool,
}

impl From<bool> for Value {
    fn from(truth: bool) -> Self {
        Self { bits: truth.into(), is_unsigned: false }
    }
}

impl Value {
    /// Returns the value of a decimal, hexadecimal or octal integer with C's suffixes; `None` for any other text.
    /// A number that is too large for a signed value is unsigned, even without the suffix `u`.
    pub(super) fn of_number(text: &str) -> Option<Self> {
        let digits = text.trim_end_matches(['u', 'U', 'l', 'L']);
        let bits = bits(digits)?;
        let is_unsigned = text[digits.len()..].contains(['u', 'U']) || i64::try_from(bits).is_err();
        Some(Self { bits, is_unsigned })
    }

    pub(super) fn is_true(self) -> bool {
        self.bits != 0
    }

    /// Returns this value in the common type of two operands, `self` and `other`: unsigned if one of the operands is
    /// unsigned.
    pub(super) fn beside(self, other: Self) -> Self {
        Self { is_unsigned: self.is_unsigned || other.is_unsigned, ..self }
    }

    /// Returns the result of one of C's unary operators `!`, `-`, `~` and `+` for this value.
    pub(super) fn after(self, operator: &str) -> Self {
        match operator {
            "!" => (!self.is_true()).into(),
            "-" => Self { bits: self.bits.wrapping_neg(), ..self },
            "~" => Self { bits: !self.bits, ..self },
            _ => self,
        }
    }

    /// Returns the result of one of C's binary operators for this value and `right`; `None` for a division by zero.
    pub(super) fn then(self, operator: &str, right: Self) -> Option<Self> {
        let (a, b) = (self.beside(right).wide(), right.beside(self).wide());
        let bits = match operator {
            "||" => return Some((self.is_true() || right.is_true()).into()),
            "&&" => return Some((self.is_true() && right.is_true()).into()),
            "==" => return Some((a == b).into()),
            "!=" => return Some((a != b).into()),
            "<" => return Some((a < b).into()),
            ">" => return Some((a > b).into()),
            "<=" => return Some((a <= b).into()),
            ">=" => return Some((a >= b).into()),
            // The left operand of a shift keeps its type.
            "<<" => return Some(Self { bits: self.bits.wrapping_shl(right.bits as u32), ..self }),
            ">>" => return Some(Self { bits: (self.wide() >> (right.bits % 64)) as u64, ..self }),
            "/" | "%" if b == 0 => return None,
            "|" => a | b,
            "^" => a ^ b,
            "&" => a & b,
            "+" => a + b,
            "-" => a - b,
            "*" => a.wrapping_mul(b),
            "/" => a / b,
            _ => a % b,
        };
        Some(Self { bits: bits as u64, ..self.beside(right) })
    }

    /// Returns the value as an integer of a type that has room for all signed and unsigned values.
    fn wide(self) -> i128 {
        if self.is_unsigned { self.bits.into() } else { (self.bits as i64).into() }
    }
}

/// Returns the bits of a decimal, hexadecimal or octal integer without suffixes; `None` for any other text.
fn bits(digits: &str) -> Option<u64> {
    if let Some(hexadecimal) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        return u64::from_str_radix(hexadecimal, 16).ok();
    }
    match digits.strip_prefix('0') {
        Some(octal) if !octal.is_empty() => u64::from_str_radix(octal, 8).ok(),
        _ => digits.parse().ok(),
    }
}
