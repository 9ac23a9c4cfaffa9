//! How an episode ended, in a sentence: with whom, where, when.

use wire::proto::event::Kind;
use wire::proto::{EndReason, Event};

use crate::advance::Advance;

/// The sentence on an episode that ended by its rules after so many steps, of `most_steps` that may be driven.
pub fn detail(advance: &Advance, steps: u32, most_steps: u32) -> String {
    let record = &advance.record;
    let said = |kind: Kind| {
        let counts = |event: &&Event| event.kind() == kind && !event.netted;
        let texts: Vec<&str> = advance.events.iter().filter(counts).map(|event| event.text.as_str()).collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    };
    let at = |what: Option<String>| format!("step {}: {}", record.step, what.unwrap_or_default());
    match advance.ended {
        Some(EndReason::Collision) => at(said(Kind::Collision)),
        Some(EndReason::OffRoute) => {
            at(said(Kind::OffRoute).or_else(|| Some(format!("{:.1} m from the route", record.route_distance))))
        }
        Some(EndReason::Horizon) => format!("all {steps} steps were driven"),
        Some(EndReason::LogEnd) => format!("the log ends after {steps} of {most_steps} steps"),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(ended: EndReason, events: Vec<Event>) -> String {
        let mut advance = Advance { ended: Some(ended), events, ..Advance::default() };
        advance.record.step = 60;
        advance.record.route_distance = 5.25;
        detail(&advance, 61, 150)
    }

    #[test]
    fn every_end_is_told() {
        let event = |kind: Kind, text: &str, netted| Event {
            kind: kind.into(),
            text: text.to_owned(),
            netted,
            ..Event::default()
        };
        let events = vec![
            event(Kind::Speeding, "too fast", false),
            event(Kind::Collision, "side to side with vehicle 7", true),
            event(Kind::Collision, "the AV's front struck vehicle 12 at 3.0 m/s, at fault", false),
        ];
        let collision = "step 60: the AV's front struck vehicle 12 at 3.0 m/s, at fault";
        assert_eq!(told(EndReason::Collision, events), collision);
        assert_eq!(told(EndReason::OffRoute, Vec::new()), "step 60: 5.2 m from the route");
        assert_eq!(told(EndReason::Horizon, Vec::new()), "all 61 steps were driven");
        assert_eq!(told(EndReason::LogEnd, Vec::new()), "the log ends after 61 of 150 steps");
    }
}
