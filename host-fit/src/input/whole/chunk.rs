//! A few thousand rows of a long log, column by column: 46 bytes a row where codes have 24 bits
//! at most and the log holds those of the gaps.

use crate::input::dataset::{LoggedFrame, Row};
use runtime::{RawFrame, VerticalPose};
use std::hash::{Hash, Hasher};

/// Codes of three converters, in as few bytes as those of the chunk need.
#[derive(Clone, Debug, PartialEq)]
enum Codes {
    Of24Bits(Vec<[[u8; 3]; 3]>),
    Of32Bits(Vec<[i32; 3]>),
}

impl Codes {
    fn push(&mut self, codes: [i32; 3]) {
        if let Self::Of24Bits(short) = self {
            let fits = |code: i32| (-(1 << 23)..1 << 23).contains(&code);
            if codes.into_iter().all(fits) {
                short.push(codes.map(|code| {
                    let [a, b, c, _] = code.to_le_bytes();
                    [a, b, c]
                }));
                return;
            }
            *self = Self::Of32Bits(short.iter().map(|codes| codes.map(code)).collect());
        }
        if let Self::Of32Bits(long) = self {
            long.push(codes);
        }
    }

    #[inline]
    fn at(&self, k: usize) -> [i32; 3] {
        match self {
            Self::Of24Bits(short) => short[k].map(code),
            Self::Of32Bits(long) => long[k],
        }
    }
}

/// The code of 24 bits, its sign extended.
const fn code([a, b, c]: [u8; 3]) -> i32 {
    i32::from_le_bytes([0, a, b, c]) >> 8
}

/// Times: since that of the first row where that is within 35 minutes.
#[derive(Clone, Debug, PartialEq)]
enum Times {
    Near { first_us: i64, since_us: Vec<i32> },
    Far(Vec<i64>),
}

impl Times {
    fn push(&mut self, t_us: i64) {
        if let Self::Near { first_us, since_us } = self {
            let since = t_us.checked_sub(*first_us);
            if let Some(near) = since.and_then(|since| i32::try_from(since).ok()) {
                since_us.push(near);
                return;
            }
            let far = since_us.iter().map(|&since| *first_us + i64::from(since));
            *self = Self::Far(far.collect());
        }
        if let Self::Far(far) = self {
            far.push(t_us);
        }
    }

    #[inline]
    fn at(&self, k: usize) -> i64 {
        match self {
            Self::Near { first_us, since_us } => first_us + i64::from(since_us[k]),
            Self::Far(far) => far[k],
        }
    }
}

/// What the log holds of Z, Rx, Ry.
#[derive(Clone, Debug, PartialEq)]
enum Vertical {
    Codes(Codes),
    /// m, rad, rad.
    Pose(Vec<[f64; 3]>),
}

/// A row without what follows from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time within the log, us.
    pub t_us: i64,
    /// Codes of the probes A, B, C.
    pub hall: [i32; 3],
    /// What the log holds of Z, Rx, Ry.
    pub vertical: SampledVertical,
    /// X, Y, Rz by the interferometers: m, m, rad.
    pub reference: [f64; 3],
}

/// Codes of the gaps, or the vertical pose itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SampledVertical {
    /// Codes of the gaps 1, 2, 3.
    Codes([i32; 3]),
    /// Z, Rx, Ry: m, rad, rad.
    Pose([f64; 3]),
}

impl Sample {
    /// What the decoder takes; its sequence number is still 0.
    #[inline]
    pub fn frame(&self) -> LoggedFrame {
        let (hall, sequence, time_us) = (self.hall, 0, self.t_us as u32);
        match self.vertical {
            SampledVertical::Codes(capacitive) => LoggedFrame::Codes(RawFrame {
                hall,
                capacitive,
                sequence,
                time_us,
            }),
            SampledVertical::Pose(vertical) => LoggedFrame::HallCodes {
                hall,
                vertical: VerticalPose::from_array(vertical.map(|x| x as f32)),
                sequence,
                time_us,
            },
        }
    }

    /// Feeds a hash, which tells logs from each other.
    pub(super) fn hash(&self, hash: &mut impl Hasher) {
        (self.t_us, self.hall).hash(hash);
        match self.vertical {
            SampledVertical::Codes(codes) => codes.hash(hash),
            SampledVertical::Pose(pose) => pose.map(f64::to_bits).hash(hash),
        }
        self.reference.map(f64::to_bits).hash(hash);
    }

    /// What a row was made of.
    pub const fn of(row: &Row) -> Self {
        Self {
            t_us: row.t_us,
            hall: row.frame.hall(),
            vertical: match &row.frame {
                LoggedFrame::Codes(frame) => SampledVertical::Codes(frame.capacitive),
                LoggedFrame::HallCodes { .. } => SampledVertical::Pose(row.vertical),
            },
            reference: row.reference,
        }
    }
}

/// Rows that follow each other in a log, all of one form.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    times: Times,
    hall: Codes,
    vertical: Vertical,
    reference: Vec<[f64; 3]>,
}

impl Chunk {
    /// Most rows of a chunk.
    pub const ROWS_MAX: usize = 4096;

    /// A chunk with its first row.
    pub fn new(first: &Sample) -> Self {
        let mut chunk = Self {
            times: Times::Near {
                first_us: first.t_us,
                since_us: Vec::with_capacity(Self::ROWS_MAX),
            },
            hall: Codes::Of24Bits(Vec::with_capacity(Self::ROWS_MAX)),
            vertical: match first.vertical {
                SampledVertical::Codes(_) => {
                    Vertical::Codes(Codes::Of24Bits(Vec::with_capacity(Self::ROWS_MAX)))
                }
                SampledVertical::Pose(_) => Vertical::Pose(Vec::with_capacity(Self::ROWS_MAX)),
            },
            reference: Vec::with_capacity(Self::ROWS_MAX),
        };
        chunk.push(first);
        chunk
    }

    /// Adds a row; `false` if the chunk is full or of another form.
    pub fn push(&mut self, sample: &Sample) -> bool {
        if self.len() == Self::ROWS_MAX {
            return false;
        }
        match (&mut self.vertical, sample.vertical) {
            (Vertical::Codes(codes), SampledVertical::Codes(more)) => codes.push(more),
            (Vertical::Pose(poses), SampledVertical::Pose(more)) => poses.push(more),
            _ => return false,
        }
        self.times.push(sample.t_us);
        self.hall.push(sample.hall);
        self.reference.push(sample.reference);
        true
    }

    /// How many rows it holds, at least one.
    #[expect(clippy::len_without_is_empty, reason = "it never is")]
    pub const fn len(&self) -> usize {
        self.reference.len()
    }

    /// The memory that each of its rows takes, bytes.
    pub const fn row_bytes(&self) -> usize {
        const fn of(codes: &Codes) -> usize {
            match codes {
                Codes::Of24Bits(_) => 9,
                Codes::Of32Bits(_) => 12,
            }
        }
        let time = match self.times {
            Times::Near { .. } => 4,
            Times::Far(_) => 8,
        };
        let vertical = match &self.vertical {
            Vertical::Codes(codes) => of(codes),
            Vertical::Pose(_) => 24,
        };
        time + of(&self.hall) + vertical + size_of::<[f64; 3]>()
    }

    /// The row `k`, from 0 to less than the length.
    #[inline]
    pub fn at(&self, k: usize) -> Sample {
        Sample {
            t_us: self.times.at(k),
            hall: self.hall.at(k),
            vertical: match &self.vertical {
                Vertical::Codes(codes) => SampledVertical::Codes(codes.at(k)),
                Vertical::Pose(poses) => SampledVertical::Pose(poses[k]),
            },
            reference: self.reference[k],
        }
    }

    /// Bytes of its columns.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        let codes = |codes: &Codes| match codes {
            Codes::Of24Bits(short) => size_of_val(short.as_slice()),
            Codes::Of32Bits(long) => size_of_val(long.as_slice()),
        };
        let times = match &self.times {
            Times::Near { since_us, .. } => size_of_val(since_us.as_slice()),
            Times::Far(far) => size_of_val(far.as_slice()),
        };
        let vertical = match &self.vertical {
            Vertical::Codes(gaps) => codes(gaps),
            Vertical::Pose(poses) => size_of_val(poses.as_slice()),
        };
        times + codes(&self.hall) + vertical + size_of_val(self.reference.as_slice())
    }
}
