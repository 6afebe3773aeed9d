//! Rows of a stream that have readings of only some of its quantities: a magnetometer often has a rate and rows of its own.

use super::column::Column;
use super::{width, Channel, Stream};

/// Whether a row has readings, but none of the wanted channels. False if all channels are wanted, or none.
pub fn lacks(stream: &Stream, row: usize, wanted: impl Fn(usize, &Channel) -> bool) -> bool {
    let has = |c: &Channel| {
        let width = width(c.quantity);
        (width * row..width * (row + 1)).any(|k| c.values.get(k).is_some_and(|v| !v.is_nan()))
    };
    let (mut any_wanted, mut others) = (false, false);
    for (i, channel) in stream.channels.iter().enumerate() {
        match (wanted(i, channel), has(channel)) {
            (true, true) => return false,
            (true, false) => any_wanted = true,
            (false, there) => others |= there,
        }
    }
    any_wanted && others
}

/// The stream without the rows that lack the wanted channels: they would become samples without a reading.
pub fn without_lacking(stream: Stream, wanted: impl Fn(usize, &Channel) -> bool) -> Stream {
    if stream.channels.iter().enumerate().all(|(i, c)| wanted(i, c)) {
        return stream;
    }
    let rows = 0..stream.time_s.len();
    let kept: Vec<usize> = rows.clone().filter(|row| !lacks(&stream, *row, &wanted)).collect();
    if kept.len() == rows.len() {
        return stream;
    }
    let of = |values: &Column, width: usize| {
        let mut all = vec![0.0; width * kept.len()];
        all.chunks_mut(width).zip(&kept).for_each(|(to, row)| values.read(width * row, to));
        Column::from(all)
    };
    let channel = |c: &Channel| Channel { quantity: c.quantity, values: of(&c.values, width(c.quantity)) };
    Stream {
        name: stream.name.clone(),
        time_s: of(&stream.time_s, 1),
        channels: stream.channels.iter().map(channel).collect(),
    }
}
