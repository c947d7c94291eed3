//! Refuses an image with slow or wrong arithmetic in it.
//!
//! The hand-written routines of avr-libc and libgcc are used only while these libraries come before
//! `compiler_builtins` in link order. If that order is lost everything still works, but five times slower.
//! `i32::checked_mul` and similar functions call `__mulosi4`, to which the compiler passes the address of a C `int`
//! for the overflow flag. A C `int` has 16 bits on AVR, but `compiler_builtins` writes 32 bits, and so overwrites
//! what lies behind it on the stack, such as the caller's frame pointer.

use anyhow::{Result, ensure};

use super::Image;

/// Fails when the image contains Rust's soft float, any `f64` or 128-bit arithmetic, or a routine that overwrites the
/// stack.
pub fn check(image: &Image) -> Result<()> {
    let found: Vec<_> = image.named(is_forbidden).map(|s| format!("  {}", s.name)).collect();
    ensure!(
        found.is_empty(),
        "{} contains arithmetic that must not be in firmware:\n{}\n\
         `compiler_builtins::float` means that the link order was lost which puts avr-libc's and \
         libgcc's routines first;\n`df` and `ti` routines mean that something computes in \
         `f64` or 128 bits.\n`__mulosi4` and `__mulodi4` overwrite the stack: nothing may check \
         whether a signed product of 32 or 64 bits overflows.",
        image.path.display(),
        found.join("\n")
    );
    Ok(())
}

fn is_forbidden(name: &str) -> bool {
    let routine = name.rsplit("::").next().unwrap_or(name);
    is_rust_float(name) || is_double(routine) || is_wide(routine) || is_wrong(routine)
}

fn is_rust_float(name: &str) -> bool {
    const MODULES: [&str; 4] = ["add", "sub", "mul", "div"];
    let Some(at) = name.find("compiler_builtins::float::") else { return false };
    let module = &name[at + "compiler_builtins::float::".len()..];
    MODULES.iter().any(|m| module.strip_prefix(m).is_some_and(|rest| rest.starts_with("::")))
}

/// `__adddf3`, `__extendsfdf2`, `__fixdfsi`, `__floatsidf`, `__ltdf2`, `__powidf2`.
fn is_double(routine: &str) -> bool {
    let Some(body) = routine.strip_prefix("__") else { return false };
    let stem = body.trim_end_matches(['2', '3']);
    let sources = ["fixdf", "fixunsdf", "truncdf"];
    stem.ends_with("df") || sources.iter().any(|source| body.starts_with(source))
}

/// `__multi3`, `__udivti3`, `__ashlti3`; inside `compiler_builtins` also `u128_div_rem`.
fn is_wide(routine: &str) -> bool {
    let body = routine.strip_prefix("__").map(|body| body.trim_end_matches(['2', '3', '4', 'o']));
    body.is_some_and(|stem| stem.ends_with("ti")) || routine.starts_with("u128_div_rem")
}

fn is_wrong(routine: &str) -> bool {
    matches!(routine, "__mulosi4" | "__mulodi4")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rusts_soft_float_is_forbidden() {
        assert!(is_forbidden("compiler_builtins::float::add::__addsf3"));
        assert!(is_forbidden("compiler_builtins::float::mul::__mulsf3"));
        assert!(is_forbidden("compiler_builtins::float::div::div::<f32>"));
        assert!(is_forbidden("<f32 as compiler_builtins::float::add::AddExt>::go"));
    }

    #[test]
    fn doubles_are_forbidden() {
        for name in ["__adddf3", "__muldf3", "__divdf3", "__extendsfdf2", "__truncdfsf2"] {
            assert!(is_forbidden(name), "{name}");
        }
        for name in ["__fixdfsi", "__fixunsdfdi", "__floatsidf", "__ltdf2", "__unorddf2"] {
            assert!(is_forbidden(name), "{name}");
        }
    }

    #[test]
    fn wide_integers_are_forbidden() {
        for name in ["__multi3", "__udivti3", "__ashlti3", "__udivmodti4", "__muloti4"] {
            assert!(is_forbidden(name), "{name}");
        }
        assert!(is_forbidden("compiler_builtins::int::specialized_div_rem::u128_div_rem"));
    }

    #[test]
    fn what_overwrites_the_stack_is_forbidden() {
        for name in ["__mulosi4", "compiler_builtins::int::mul::__mulodi4"] {
            assert!(is_forbidden(name), "{name}");
        }
    }

    #[test]
    fn the_hand_written_routines_are_welcome() {
        for name in ["__addsf3", "__addsf3x", "__mulsf3", "__divsf3", "__floatsisf", "sqrtf"] {
            assert!(!is_forbidden(name), "{name}");
        }
        for name in ["__muldi3", "__udivmod64", "__udivmodsi4", "__mulsi3", "__umulhisi3", "main"] {
            assert!(!is_forbidden(name), "{name}");
        }
        assert!(!is_forbidden("compiler_builtins::float::conv::__floatdisf"));
        assert!(!is_forbidden("kerf::motion::profile::add"));
    }
}
