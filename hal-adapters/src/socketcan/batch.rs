//! Frames as the kernel's sockets hold them (16 bytes), many per call: a call costs more than
//! a frame.

use crate::can::{BusFrame, StampedFrame};
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use nix::errno::Errno;
use nix::sys::socket::{ControlMessageOwned, MsgFlags, MultiHeaders, recvmmsg, sendmmsg};
use nix::sys::time::TimeSpec;
use std::collections::VecDeque;
use std::io::{IoSlice, IoSliceMut};
use std::os::fd::RawFd;
use std::vec;
use std::vec::Vec;

/// Frames of one call.
pub(super) const BATCH: usize = 64;

/// Bytes of a classic frame at a socket: identifier, length, three unused, eight data.
const WIRE_BYTES: usize = 16;

const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// The bytes of a frame at a socket.
fn to_wire(frame: &BusFrame) -> [u8; WIRE_BYTES] {
    let id = match frame.id {
        Id::Standard(id) => u32::from(id.as_raw()),
        Id::Extended(id) => id.as_raw() | EXTENDED,
    };
    let id = if frame.is_remote_frame() {
        id | REMOTE
    } else {
        id
    };
    let mut wire = [0; WIRE_BYTES];
    let [i0, i1, i2, i3, length, _, _, _, data @ ..] = &mut wire;
    [*i0, *i1, *i2, *i3] = id.to_ne_bytes();
    *length = frame.dlc() as u8;
    for (to, from) in data.iter_mut().zip(frame.data()) {
        *to = *from;
    }
    wire
}

/// The frame of a socket's bytes; `None` for an error of the controller.
fn from_wire(wire: &[u8; WIRE_BYTES]) -> Option<BusFrame> {
    let [i0, i1, i2, i3, length, _, _, _, data @ ..] = wire;
    let raw = u32::from_ne_bytes([*i0, *i1, *i2, *i3]);
    if raw & ERROR != 0 {
        return None;
    }
    let id = if raw & EXTENDED != 0 {
        Id::Extended(ExtendedId::new(raw & 0x1fff_ffff)?)
    } else {
        Id::Standard(StandardId::new((raw & 0x7ff) as u16)?)
    };
    let length = usize::from(*length).min(8);
    if raw & REMOTE != 0 {
        BusFrame::new_remote(id, length)
    } else {
        BusFrame::new(id, data.get(..length)?)
    }
}

/// Reads up to [`BATCH`] frames without waiting; returns how many the kernel gave.
pub(super) fn receive(fd: RawFd, into: &mut VecDeque<StampedFrame>) -> Result<usize, Errno> {
    let mut wires = [[0; WIRE_BYTES]; BATCH];
    let mut slices: Vec<_> = wires.iter_mut().map(|w| [IoSliceMut::new(w)]).collect();
    // New for every call: a call overwrites the length of the control buffer.
    let control = nix::cmsg_space!(TimeSpec);
    let mut headers = MultiHeaders::<()>::preallocate(BATCH, Some(control));
    let got = recvmmsg(
        fd,
        &mut headers,
        slices.iter_mut(),
        MsgFlags::MSG_DONTWAIT,
        None,
    )?;
    let mut count = 0;
    for message in got {
        count += 1;
        let stamp = message.cmsgs()?.find_map(|control| match control {
            ControlMessageOwned::ScmTimestampns(time) => Some(micros(&time)),
            _ => None,
        });
        let wire = message.iovs().next().and_then(|bytes| bytes.first_chunk());
        if let (Some(time_us), Some(frame)) = (stamp, wire.and_then(from_wire)) {
            into.push_back(StampedFrame { time_us, frame });
        }
    }
    Ok(count)
}

/// Hands up to [`BATCH`] frames to the kernel; returns how many it took.
pub(super) fn send(fd: RawFd, frames: &[BusFrame]) -> Result<usize, Errno> {
    let wires: Vec<_> = frames.iter().take(BATCH).map(to_wire).collect();
    let slices: Vec<_> = wires.iter().map(|w| [IoSlice::new(w)]).collect();
    let mut headers = MultiHeaders::<()>::preallocate(slices.len(), None);
    let addresses: Vec<Option<()>> = slices.iter().map(|_| None).collect();
    let sent = sendmmsg(
        fd,
        &mut headers,
        &slices,
        addresses,
        [],
        MsgFlags::MSG_DONTWAIT,
    )?;
    Ok(sent.count())
}

fn micros(time: &TimeSpec) -> u64 {
    let seconds = u64::try_from(time.tv_sec()).unwrap_or(0);
    let micros = u64::try_from(time.tv_nsec()).unwrap_or(0) / 1_000;
    seconds.saturating_mul(1_000_000).saturating_add(micros)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_at_a_socket_worked_by_hand() {
        let id = StandardId::new(0x123).expect("11 bits");
        let frame = BusFrame::new(id, &[1, 2, 3]).expect("three bytes");
        let [i0, i1, i2, i3] = 0x123u32.to_ne_bytes();
        let wire = [i0, i1, i2, i3, 3, 0, 0, 0, 1, 2, 3, 0, 0, 0, 0, 0];
        assert_eq!(to_wire(&frame), wire);
        let mut error = wire;
        error[..4].copy_from_slice(&(0x123 | ERROR).to_ne_bytes());
        assert_eq!(from_wire(&error), None);
    }
}
