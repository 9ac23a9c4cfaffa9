//! The player's controls and what it plays. The picture is the page's script's.

use maud::{Markup, html};

use super::{Played, Source};

/// The section; empty where nothing is played.
pub fn section(sources: &[Source], played: &[Played]) -> Markup {
    if played.is_empty() {
        return html! {};
    }
    html! {
        noscript { p.note { "Drives are played by a script, which does not run here." } }
        div id="player" role="region" aria-label="Player" hidden {
            div.bars {
                select.grow id="choice" aria-label="Drive" {
                    @for (index, one) in played.iter().enumerate() {
                        option value=(index) { (one.scene) " · " (sources[one.run].label) }
                    }
                }
                button type="button" id="previous" aria-label="Previous drive" { "‹ Drive" }
                button type="button" id="next" aria-label="Next drive" { "Drive ›" }
            }
            h3 id="title" {}
            p.note id="ended" {}
            canvas id="stage" tabindex="0" role="img" aria-label="The drive from above; space plays, arrows step" {}
            canvas id="timeline" aria-hidden="true" {}
            input id="range" type="range" min="0" max="1" value="0" aria-label="Step";
            div.bars {
                button.main type="button" id="play" { "Play" }
                button type="button" id="back" aria-label="A step back" { "‹ Step" }
                button type="button" id="forth" aria-label="A step on" { "Step ›" }
                button type="button" id="event-back" aria-label="The event before" { "‹ Event" }
                button type="button" id="event-forth" aria-label="The next event" { "Event ›" }
                select id="rate" aria-label="Speed" {
                    @for (rate, name) in [("0.25", "¼ ×"), ("0.5", "½ ×"), ("1", "1 ×"), ("2", "2 ×"), ("4", "4 ×")] {
                        option value=(rate) selected[rate == "1"] { (name) }
                    }
                }
                button type="button" id="farther" aria-label="Show more" { "−" }
                button type="button" id="nearer" aria-label="Show less" { "+" }
            }
            p.readings {
                span { "step " b id="step" {} } span { "time " b id="seconds" {} } span { "speed " b id="speed" {} }
                span { "limit " b id="limit" {} } span { "acceleration " b id="acceleration" {} }
            }
            div.bars {
                label { input id="plans" type="checkbox" checked; "plan" }
                label { input id="futures" type="checkbox" checked; "predictions" }
                label { input id="log" type="checkbox" checked; "the log's own AV" }
                label id="beside-label" { input id="beside" type="checkbox" checked; "the AV of " span id="beside-name" {} }
            }
            p.note id="drive-note" {}
            div.two {
                div { p.note id="nothing" { "Nothing happened." } ul.events id="events" aria-label="Events" {} }
                div {
                    ul.legend {
                        @for (class, name) in LEGEND { li { i class=(class) {} (name) } }
                        li id="reacts-legend" { i.reacts {} "nose of who reacts to the AV" }
                        li id="beside-legend" { i.beside {} "AV of " span id="beside-legend-name" {} }
                    }
                    p.keys {
                        kbd { "space" } " plays, " kbd { "←" } " " kbd { "→" } " step (shift: ten), " kbd { "[" } " " kbd { "]" }
                        " events, " kbd { "home" } " " kbd { "end" } ", " kbd { "+" } " " kbd { "-" } " zoom, " kbd { "p" } " " kbd { "n" } " drives"
                    }
                }
            }
        }
        @for one in played {
            script.reel type="text/plain" data-scene=(one.scene) data-run=(sources[one.run].label) data-end=(one.end) data-note=(one.reel.note) {
                (one.reel.letters)
            }
        }
    }
}

const LEGEND: [(&str, &str); 8] = [
    ("av", "AV"),
    ("plan line", "plan"),
    ("future line", "prediction"),
    ("log", "the log's AV"),
    ("vehicle", "vehicle"),
    ("pedestrian", "pedestrian"),
    ("cyclist", "cyclist"),
    ("other", "other"),
];
