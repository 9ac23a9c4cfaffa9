//! Recordings and messages that were changed anywhere make no panic.

use proptest::prelude::*;
use recorder::fuzzing;
use recorder::message::CHANNELS;

use recording::mutants::{Dice, mutant};

use crate::{mcap_of, synthetic};

/// The messages of an episode as [`fuzzing::messages`] reads them.
fn framed() -> Vec<u8> {
    let mut bytes = Vec::new();
    for message in synthetic::episode("damaged", synthetic::SMALL) {
        let channel = CHANNELS.iter().position(|channel| *channel == message.channel()).unwrap();
        bytes.push(channel as u8);
        bytes.extend((message.payload.len() as u32).to_le_bytes());
        bytes.extend(message.payload);
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn a_recording_with_other_bytes_is_read_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        end in any::<prop::sample::Index>(),
    ) {
        let mut bytes = mcap_of(&synthetic::episode("damaged", synthetic::SMALL));
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        fuzzing::recording(&bytes);
        fuzzing::recording(&bytes[..end.index(bytes.len())]);
    }

    #[test]
    fn messages_with_other_bytes_are_drawn_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let mut bytes = framed();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        fuzzing::messages(&bytes);
    }
}

#[test]
fn recordings_that_are_damaged_with_knowledge_of_them_are_read_or_refused() {
    let whole = mcap_of(&synthetic::episode("damaged", synthetic::SMALL));
    for seed in 0..400 {
        fuzzing::recording(&mutant(&whole, &mut Dice(seed)));
    }
}
