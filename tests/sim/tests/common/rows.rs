//! Makes a test for each row of a bench, and one test that no row is without a test.

/// Makes tests by their names. Each passes its row to `keeps_to_its_floor`. An attribute in front applies to every
/// test but the last.
macro_rules! rows {
    ($(#[$attribute:meta])? $($test:ident = $name:literal;)+) => {
        rows! { @tests [$(#[$attribute])?] $($test = $name;)+ }

        #[test]
        fn every_row_is_tested() {
            assert_eq!(ROWS.each_ref().map(|row| row.name), [$($name),+]);
        }
    };
    (@tests $attribute:tt $($test:ident = $name:literal;)+) => {
        $(rows! { @test $attribute $test = $name })+
    };
    (@test [$(#[$attribute:meta])?] $test:ident = $name:literal) => {
        #[test]
        $(#[$attribute])?
        fn $test() {
            keeps_to_its_floor($name);
        }
    };
}
