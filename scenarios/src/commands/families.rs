//! `scenarios families`: what scenes can be generated, and what can be said about them beforehand.

use std::io::{self, Write};

use scenarios::generated::{FAMILIES, Family, Parameter};

use super::Failure;
use super::table::table;
use crate::cli::FamiliesArguments;

pub fn run(arguments: &FamiliesArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let written = match &arguments.name {
        None => write_families(out),
        Some(name) => {
            let family = Family::named(name).ok_or_else(|| Failure::NoFamily(name.clone()))?;
            writeln!(out, "{}: {}\n", family.name, family.about)
                .and_then(|()| write_parameters(family.all_parameters(), out))
        }
    };
    written.map(|()| false).map_err(Failure::Output)
}

fn write_families(out: &mut impl Write) -> io::Result<()> {
    let mut table = table(&["family", "what happens"]);
    for family in FAMILIES {
        table.add_row([family.name, family.about]);
    }
    writeln!(out, "{}\n\nscenarios families NAME shows a family's parameters.", table.trim_fmt())
}

fn write_parameters(parameters: impl Iterator<Item = &'static Parameter>, out: &mut impl Write) -> io::Result<()> {
    let mut table = table(&["parameter", ">from", ">to", ">least", ">most", "what it is"]);
    for Parameter { name, about, default, limits } in parameters {
        let [from, to, least, most] = [default[0], default[1], limits[0], limits[1]].map(|number| number.to_string());
        table.add_row([(*name).to_owned(), from, to, least, most, (*about).to_owned()]);
    }
    if table.is_empty() {
        return writeln!(out, "It has no parameters.");
    }
    writeln!(
        out,
        "{}\n\nEach scene draws a number between from and to. --set name=low..high narrows that down, within least and most.",
        table.trim_fmt()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_shown_with_their_ranges() {
        const PARAMETERS: [Parameter; 2] = [
            Parameter { name: "gap", about: "room that is left (m)", default: [4.0, 12.5], limits: [0.0, 60.0] },
            Parameter { name: "traffic", about: "how dense it is", default: [0.5, 0.5], limits: [0.0, 2.0] },
        ];
        let shown = |parameters: &'static [Parameter]| {
            let mut out = Vec::new();
            write_parameters(parameters.iter(), &mut out).unwrap();
            String::from_utf8(out).unwrap()
        };
        insta::assert_snapshot!(shown(&PARAMETERS));
        assert_eq!(shown(&[]), "It has no parameters.\n");
    }
}
