//! The one table of messages, identifiers, signals and units. Code, documentation
//! (`protocol.md`) and the `.dbc` file follow from it.

use super::signals::{self, Signal};
use embedded_can::{Id, StandardId};

/// The messages, by priority on the bus: the lowest identifier wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Message {
    /// Hall codes of 16 bits.
    Hall,
    /// Capacitive codes of 16 bits.
    Capacitive,
    /// Hall codes A and B of 24 bits.
    HallAb24,
    /// Hall code C and capacitive code 1 of 24 bits.
    HallCCapacitive1At24,
    /// Capacitive codes 2 and 3 of 24 bits.
    Capacitive23At24,
    /// Number and time of a tick by the sensor node's clock.
    SensorTime,
    /// X with its status.
    PoseX,
    /// Y with its status.
    PoseY,
    /// Rz with its status.
    PoseRz,
    /// Z with its status.
    PoseZ,
    /// Rx with its status.
    PoseRx,
    /// Ry with its status.
    PoseRy,
    /// State of the decoding node.
    NodeStatus,
    /// A request to the decoding node.
    Command,
    /// Its answer.
    Answer,
    /// Counters of the decoding node, one after the other.
    Health,
    /// Serial number of the stage, six characters a page.
    Identity,
    /// Number and time of the tick whose pose was just sent.
    PoseTime,
    /// A word of new parameters.
    UpdateData,
}

/// Who sends a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Node {
    /// The data-acquisition node with the converters.
    Sensor,
    /// The node that decodes: a controller or a computer.
    Decoder,
    /// Whoever commands it.
    Host,
}

impl Node {
    /// Every node.
    pub const ALL: [Self; 3] = [Self::Sensor, Self::Decoder, Self::Host];

    /// Its name in the `.dbc` file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sensor => "Sensor",
            Self::Decoder => "Decoder",
            Self::Host => "Host",
        }
    }
}

/// When a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Every so many ticks.
    Ticks(u8),
    /// Every so many ticks by default; the sender can be set to 1 to 16.
    Decimated(u8),
    /// When asked for.
    OnRequest,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Which message.
    pub message: Message,
    /// Its name in the `.dbc` file.
    pub name: &'static str,
    /// Standard identifier.
    pub id: u16,
    /// Key of its data ID list; see [`super::e2e`].
    pub key: u8,
    /// Who sends it.
    pub sender: Node,
    /// When.
    pub rate: Rate,
    /// What it carries.
    pub what: &'static str,
    /// Its signals besides check and counter.
    pub signals: &'static [Signal],
}

const fn row(
    message: Message,
    name: &'static str,
    (id, key): (u16, u8),
    (sender, rate): (Node, Rate),
    what: &'static str,
    signals: &'static [Signal],
) -> Spec {
    Spec {
        message,
        name,
        id,
        key,
        sender,
        rate,
        what,
        signals,
    }
}

use Message as M;
use Node::{Decoder, Host, Sensor};

/// Ticks between two frames of [`Message::SensorTime`], [`Message::PoseTime`],
/// [`Message::NodeStatus`] and [`Message::Health`].
pub const SLOW_TICKS: u8 = 16;

/// Default of the vertical pose: each axis in every fourth tick.
pub const VERTICAL_TICKS: u8 = 4;

const EVERY: Rate = Rate::Ticks(1);
const SLOW: Rate = Rate::Ticks(SLOW_TICKS);
const VERTICAL: Rate = Rate::Decimated(VERTICAL_TICKS);

/// The table, in the order of [`Message`] and of rising identifier.
///
/// Any two identifiers differ in at least four bits, so three flipped bits never turn one
/// message into another. Every message has eight bytes.
#[rustfmt::skip]
pub const TABLE: [Spec; 19] = [
    row(M::Hall, "Hall", (0x100, 0x0d), (Sensor, EVERY), "Hall codes of 16 bits", &signals::HALL),
    row(M::Capacitive, "Capacitive", (0x10f, 0x1a), (Sensor, EVERY), "capacitive codes of 16 bits", &signals::CAPACITIVE),
    row(M::HallAb24, "HallAb24", (0x133, 0x27), (Sensor, EVERY), "second layout: Hall codes A and B of up to 24 bits", &signals::HALL_AB_24),
    row(M::HallCCapacitive1At24, "HallCCapacitive1At24", (0x13c, 0x34), (Sensor, EVERY), "second layout: Hall code C and capacitive code 1", &signals::HALL_C_CAPACITIVE_1_24),
    row(M::Capacitive23At24, "Capacitive23At24", (0x155, 0x41), (Sensor, EVERY), "second layout: capacitive codes 2 and 3", &signals::CAPACITIVE_23_24),
    row(M::SensorTime, "SensorTime", (0x15a, 0x4e), (Sensor, SLOW), "number and time of the tick that follows", &signals::SENSOR_TIME),
    row(M::PoseX, "PoseX", (0x166, 0x5b), (Decoder, EVERY), "X", &signals::POSE_X),
    row(M::PoseY, "PoseY", (0x169, 0x68), (Decoder, EVERY), "Y", &signals::POSE_Y),
    row(M::PoseRz, "PoseRz", (0x196, 0x75), (Decoder, EVERY), "Rz", &signals::POSE_RZ),
    row(M::PoseZ, "PoseZ", (0x199, 0x82), (Decoder, VERTICAL), "Z", &signals::POSE_Z),
    row(M::PoseRx, "PoseRx", (0x1a5, 0x8f), (Decoder, VERTICAL), "Rx", &signals::POSE_RX),
    row(M::PoseRy, "PoseRy", (0x1aa, 0x9c), (Decoder, VERTICAL), "Ry", &signals::POSE_RY),
    row(M::NodeStatus, "NodeStatus", (0x1c3, 0xa9), (Decoder, SLOW), "what the decoding node is doing", &signals::NODE_STATUS),
    row(M::Command, "Command", (0x1cc, 0xb6), (Host, Rate::OnRequest), "a request to the decoding node", &signals::COMMAND),
    row(M::Answer, "Answer", (0x1f0, 0xc3), (Decoder, Rate::OnRequest), "how a request ended", &signals::ANSWER),
    row(M::Health, "Health", (0x1ff, 0xd0), (Decoder, SLOW), "counters since start, one a frame", &signals::HEALTH),
    row(M::Identity, "Identity", (0x203, 0xdd), (Decoder, Rate::OnRequest), "serial number of the stage, six characters a page", &signals::IDENTITY),
    row(M::PoseTime, "PoseTime", (0x20c, 0xea), (Decoder, SLOW), "number and time of the tick whose X, Y, Rz came before it", &signals::POSE_TIME),
    row(M::UpdateData, "UpdateData", (0x230, 0xf7), (Host, Rate::OnRequest), "a word of new parameters, or of the tag that authorises them", &signals::UPDATE_DATA),
];

/// Bytes of every message.
pub const FRAME_BYTES: usize = 8;

/// What a node needs of a row. Where only this is used, the texts stay out of the program.
#[derive(Clone, Copy)]
struct OnTheWire {
    message: Message,
    id: u16,
    key: u8,
}

const ON_THE_WIRE: [OnTheWire; TABLE.len()] = {
    let (message, id, key) = (Message::Hall, 0, 0);
    let mut rows = [OnTheWire { message, id, key }; TABLE.len()];
    let mut k = 0;
    while k < rows.len() {
        let Spec {
            message, id, key, ..
        } = TABLE[k];
        rows[k] = OnTheWire { message, id, key };
        k += 1;
    }
    rows
};

impl Message {
    /// Its row of the table.
    #[inline(always)]
    pub const fn spec(self) -> &'static Spec {
        const ROWS: &[Spec; TABLE.len()] = &TABLE;
        // Always true. Without this comparison the compiler keeps a bounds check and its panic.
        let place = self as usize;
        if place < ROWS.len() {
            &ROWS[place]
        } else {
            &ROWS[0]
        }
    }

    #[inline(always)]
    const fn on_the_wire(self) -> &'static OnTheWire {
        const ROWS: &[OnTheWire; TABLE.len()] = &ON_THE_WIRE;
        // As in `spec`.
        let place = self as usize;
        if place < ROWS.len() {
            &ROWS[place]
        } else {
            &ROWS[0]
        }
    }

    /// Key of its data ID list; see [`super::e2e`].
    #[inline(always)]
    pub const fn key(self) -> u8 {
        self.on_the_wire().key
    }

    /// Its identifier.
    #[inline(always)]
    pub const fn id(self) -> StandardId {
        match StandardId::new(self.on_the_wire().id) {
            Some(id) => id,
            None => StandardId::MAX,
        }
    }

    /// The message with this identifier, if it is one of ours.
    pub fn from_id(id: Id) -> Option<Self> {
        let Id::Standard(id) = id else { return None };
        ON_THE_WIRE
            .iter()
            .find(|row| row.id == id.as_raw())
            .map(|row| row.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_in_the_order_of_messages_and_identifiers() {
        for (k, row) in TABLE.iter().enumerate() {
            assert_eq!(row.message as usize, k);
            assert_eq!(row.message.id().as_raw(), row.id);
            assert_eq!(row.message.key(), row.key);
            assert_eq!(
                Message::from_id(Id::Standard(row.message.id())),
                Some(row.message)
            );
            assert!(k == 0 || TABLE[k - 1].id < row.id);
        }
    }

    #[test]
    fn any_two_identifiers_differ_in_four_bits_and_any_two_keys_differ() {
        for (k, a) in TABLE.iter().enumerate() {
            for b in &TABLE[..k] {
                assert!((a.id ^ b.id).count_ones() >= 4, "{} {}", a.name, b.name);
                assert_ne!(a.key, b.key);
            }
        }
    }
}
