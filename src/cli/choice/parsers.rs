//! Parsers of arguments for clap: a local size, a number, a whole number, a time, `KEY=VALUE`.

use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

/// Parses a local size: `WIDTHxHEIGHT`, or one number for both the width and the height. Each number is from
/// 1 to 4096. Returns the width and the height.
pub fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (across, down) = text.split_once(['x', 'X']).unwrap_or((text, text));
    let number = |part: &str| match part.parse::<u32>() {
        Ok(n) if (1..=4096).contains(&n) => Ok(n),
        _ => Err(format!(
            "'{text}' is not a local size; expected WIDTHxHEIGHT, such as 16x8, or one number for both; each number is from 1 to 4096"
        )),
    };
    Ok([number(across)?, number(down)?])
}

/// Returns a parser that accepts a whole number in `range`, for clap (the library that parses raycl's
/// arguments). All error messages of this parser state the range. clap's own parser does not state the range
/// if the text is not a whole number.
pub fn whole<T: TryFrom<u32>>(
    range: RangeInclusive<u32>,
) -> impl Fn(&str) -> std::result::Result<T, String> + Clone {
    move |text| {
        let number = text.parse::<u32>().ok().filter(|number| range.contains(number));
        number.and_then(|number| T::try_from(number).ok()).ok_or_else(|| {
            match (range.start(), *range.end()) {
                (least, u32::MAX) => format!("'{text}' is not a whole number of at least {least}"),
                (least, most) => format!("'{text}' is not a whole number from {least} to {most}"),
            }
        })
    }
}

/// Returns a parser of a `T`. Its error messages say what the text should be (`what`), such as "a number of degrees,
/// such as 30".
pub fn number<T: FromStr>(what: &'static str) -> impl Fn(&str) -> std::result::Result<T, String> + Clone {
    move |text| text.parse::<T>().map_err(|_| format!("'{text}' is not {what}"))
}

/// Parses a positive number of seconds.
pub fn parse_seconds(text: &str) -> std::result::Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && seconds.is_finite());
    let seconds = seconds.ok_or_else(|| format!("'{text}' is not a positive number of seconds"))?;
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| format!("{text} s are too long; expected at most {:.1e} s", Duration::MAX.as_secs_f64()))
}

/// Splits `KEY=VALUE` at the first `=`. Returns the key and the value, without the spaces around them.
pub fn parse_assignment(text: &str) -> std::result::Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.trim().to_owned())),
        _ => Err(format!("'{text}' does not have the form KEY=VALUE")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("16x8"), Ok([16, 8]));
        assert_eq!(parse_size("16X8"), Ok([16, 8]));
        assert_eq!(parse_size("4"), Ok([4, 4]));
        assert_eq!(parse_size("4096x1"), Ok([4096, 1]));
        for wrong in ["", "x", "0x4", "-1", "4x", "4097", "8x8x8"] {
            let message = parse_size(wrong).expect_err(wrong);
            assert!(message.contains("such as 16x8, or one number for both"), "{message}");
        }
    }

    #[test]
    fn a_whole_number_that_is_refused_is_reported_with_its_range() {
        let rate = whole::<u16>(1..=1000);
        assert_eq!([rate("1"), rate("1000")], [Ok(1), Ok(1000)]);
        for wrong in ["29.97", "0", "1001", "-1", "70000", "99999999999", "many", ""] {
            assert_eq!(rate(wrong), Err(format!("'{wrong}' is not a whole number from 1 to 1000")));
        }
        let count = whole::<u32>(1..=u32::MAX);
        assert_eq!(count("4294967295"), Ok(u32::MAX));
        assert_eq!(count("0"), Err("'0' is not a whole number of at least 1".to_owned()));
    }

    #[test]
    fn text_that_is_not_a_number_is_refused_with_what_it_should_be() {
        let degrees = number::<f64>("a number of degrees, such as 30");
        assert_eq!(degrees("-30.5"), Ok(-30.5));
        assert_eq!(degrees("left"), Err("'left' is not a number of degrees, such as 30".to_owned()));
        let bytes = number::<u32>("a whole number of bytes, such as 4096");
        assert_eq!(bytes("0"), Ok(0));
        assert_eq!(bytes("4KiB"), Err("'4KiB' is not a whole number of bytes, such as 4096".to_owned()));
    }

    #[test]
    fn a_time_limit_is_a_positive_number_of_seconds() {
        assert_eq!(parse_seconds("0.25"), Ok(Duration::from_millis(250)));
        assert_eq!(parse_seconds("90"), Ok(Duration::from_secs(90)));
        let too_long = parse_seconds("1e300").expect_err("it is too long");
        assert_eq!(too_long, "1e300 s are too long; expected at most 1.8e19 s");
        for wrong in ["0", "-1", "", "1s", "nan", "inf"] {
            let message = parse_seconds(wrong).expect_err("it is no time");
            assert!(message.contains(&format!("'{wrong}'")), "{message}");
        }
    }
}
