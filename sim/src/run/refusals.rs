//! Says who was refused before any session was there. Zenoh's TLS links tell it to the log alone, with a hint about something else.

use std::fmt::Debug;
use std::sync::atomic::{AtomicU64, Ordering};

use tracing::field::{Field, Visit};
use tracing::{Event, Metadata, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{FilterFn, Filtered, filter_fn};
use tracing_subscriber::layer::Context;
use wire::session::refused_by_tls;

use super::console::Console;

/// So many are told of, then no more: a stranger must not fill the disk.
const NOTICES: u64 = 100;

/// What is heard of refusals, and where it is told.
pub struct Refusals {
    console: Console,
    told: AtomicU64,
}

impl Refusals {
    /// A layer of the log that tells of refusals on `console`, whatever the log's level.
    #[must_use]
    pub fn told_on<S: Subscriber>(console: &Console) -> Filtered<Self, FilterFn, S>
    where
        Self: Layer<S>,
    {
        let of_tls: fn(&Metadata<'_>) -> bool = |event| event.target().starts_with("zenoh_link_tls");
        Self { console: console.clone(), told: AtomicU64::new(0) }.with_filter(filter_fn(of_tls))
    }
}

impl<S: Subscriber> Layer<S> for Refusals {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Text::default();
        event.record(&mut text);
        let Some(refused) = refused_by_tls(&text.0) else { return };
        match self.told.fetch_add(1, Ordering::Relaxed) {
            NOTICES => self.console.line(&format!("warning: more of this follows, and is not told: {refused}")),
            count if count < NOTICES => self.console.line(&format!("warning: {refused}")),
            _ => {}
        }
    }
}

/// The message of an event.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}
