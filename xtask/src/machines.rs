//! The machines by name. Their settings are data in `machines/`.

use std::fmt;

use clap::ValueEnum;

/// A machine whose settings are the defaults of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Machine {
    /// A machine of which nothing is known
    #[default]
    Careful,
    /// A router of the Shapeoko class
    Router,
    /// A desktop mill of the Zen and Othermill class
    Mill,
    /// A 3D printer of the Mendel class
    Printer,
    /// A lathe
    Lathe,
}

impl Machine {
    /// The name in `machines/`, on the command line and after `machine-` in the package's features.
    pub fn name(self) -> &'static str {
        match self {
            Machine::Careful => "careful",
            Machine::Router => "router",
            Machine::Mill => "mill",
            Machine::Printer => "printer",
            Machine::Lathe => "lathe",
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::root;

    #[test]
    fn every_machine_file_has_a_name_here_and_a_feature() {
        let files = std::fs::read_dir(root().join("machines")).unwrap();
        let mut files: Vec<_> = files
            .map(|f| f.unwrap().path())
            .filter(|f| f.extension() == Some("rs".as_ref()))
            .map(|f| f.file_stem().unwrap().to_owned().into_string().unwrap())
            .collect();
        files.sort();
        let mut names: Vec<_> = Machine::value_variants().iter().map(|m| m.name()).collect();
        names.sort();
        assert_eq!(files, names);

        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        for name in names {
            assert!(
                manifest.contains(&format!("\nmachine-{name} = ")),
                "no feature machine-{name}"
            );
        }
    }

    #[test]
    fn command_line_names_are_the_machine_names() {
        for machine in Machine::value_variants() {
            assert_eq!(machine.to_possible_value().unwrap().get_name(), machine.name());
        }
    }
}
