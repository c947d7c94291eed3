//! Translates syntax in which LLVM's AVR assembler differs from that of binutils.

use std::borrow::Cow;

/// Translates a line for `avr-as`.
pub fn translate(line: &str) -> Cow<'_, str> {
    let code = line.trim_start();
    if code.starts_with(".file") {
        return file(line).map_or(Cow::Borrowed(line), Cow::Owned);
    }
    if line.contains("8_gs(") {
        return Cow::Owned(line.replace("lo8_gs(", "lo8(gs(").replace("hi8_gs(", "hi8(gs(") + ")");
    }
    match line.split_once(" = pm(") {
        Some((alias, name)) => Cow::Owned(format!("{alias} = {}", name.trim_end_matches(')'))),
        None => Cow::Borrowed(line),
    }
}

/// Translates `.file 3 "folder" "name"`, which has the folder in a string of its own.
fn file(line: &str) -> Option<String> {
    let (before, name) = line.split_once("\" \"")?;
    Some(format!("{before}/{name}"))
}

#[cfg(test)]
mod tests {
    use super::translate;

    #[test]
    fn files_are_one_string() {
        assert_eq!(translate("\t.file\t1 \"/k\" \"src/main.rs\""), "\t.file\t1 \"/k/src/main.rs\"");
        assert_eq!(translate("\t.file\t\"kerf.cgu\""), "\t.file\t\"kerf.cgu\"");
    }

    #[test]
    fn addresses_for_calls_are_two_operators() {
        assert_eq!(translate("\tldi\tr16, lo8_gs(f)"), "\tldi\tr16, lo8(gs(f))");
        assert_eq!(translate("\tldi\tr17, hi8_gs(f)"), "\tldi\tr17, hi8(gs(f))");
    }

    #[test]
    fn an_alias_is_an_address() {
        assert_eq!(translate("__vector_2 = pm(__vector_1)"), "__vector_2 = __vector_1");
    }
}
