//! Sorts frames so that parents precede children.

use super::super::locate::Mistakes;
use super::super::spec::FrameSpec;

/// Frames (counted without root) such that each follows its parent, otherwise in file order.
///
/// `parents` count root as 0 and the first frame as 1. Frames in a circle are reported and appended at the end.
pub(super) fn parents_first(frames: &[FrameSpec], parents: &[Option<usize>], mistakes: &Mistakes) -> Vec<usize> {
    let mut order = Vec::with_capacity(frames.len());
    let mut waiting: Vec<usize> = (0..frames.len()).collect();
    let mut placed = vec![false; frames.len() + 1];
    placed[0] = true;
    // An unknown parent is reported elsewhere.
    while let Some(at) = waiting.iter().position(|i| parents[*i].is_none_or(|p| placed[p])) {
        let next = waiting.remove(at);
        placed[next + 1] = true;
        order.push(next);
    }
    report_circles(frames, parents, &waiting, mistakes);
    order.extend(waiting);
    order
}

/// The place of each frame of the file (root first) in the model.
pub(super) fn places(order: &[usize], frames: usize) -> Vec<usize> {
    let mut places = vec![0; frames + 1];
    for (place, frame) in order.iter().enumerate() {
        places[frame + 1] = place + 1;
    }
    places
}

fn report_circles(frames: &[FrameSpec], parents: &[Option<usize>], waiting: &[usize], mistakes: &Mistakes) {
    let mut seen = vec![false; frames.len()];
    for start in waiting {
        let mut path: Vec<usize> = Vec::new();
        let mut next = Some(*start);
        while let Some(frame) = next.filter(|f| !seen[*f]) {
            seen[frame] = true;
            path.push(frame);
            next = parents[frame].and_then(|p| p.checked_sub(1));
        }
        if let Some(first) = next.and_then(|end| path.iter().position(|f| *f == end)) {
            report(frames, &path[first..], mistakes);
        }
    }
}

fn report(frames: &[FrameSpec], circle: &[usize], mistakes: &Mistakes) {
    let Some(first) = circle.iter().min() else {
        return;
    };
    let names: Vec<String> =
        circle.iter().chain(circle.first()).map(|f| format!("`{}`", frames[*f].name.text)).collect();
    let text = format!(
        "frame `{}`: parents run in a circle: {}; one of them must have a parent that leads to `root`",
        frames[*first].name.text,
        names.join(" -> ")
    );
    let at = frames[*first].parent.as_ref().map_or(frames[*first].name.at, |p| p.at);
    mistakes.add(at, text);
}
