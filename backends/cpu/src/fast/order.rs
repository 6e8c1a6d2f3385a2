//! Shapes that no ray of a packet meets at the same place: one pass of a kernel for each, from
//! front to back, each going on from what the ones before it left.

use super::{
    dispatch,
    over::{self, Pixels},
    packet::{Bundle, Packet, Place, Span},
    simd::{LANES, Unit},
    walk::Counts,
};

/// A shape, ready to be drawn.
pub struct Part<'a> {
    /// What its kernel needs.
    pub job: over::Job<'a>,
    /// Where it lies.
    pub place: Place,
}

/// Draws sixteen rays through all parts; returns those that met one.
pub fn draw(unit: Unit, parts: &[Part<'_>], bundle: &Bundle, pixels: &mut Pixels, counts: &mut Counts) -> u32 {
    let aimed = parts.iter().map(|p| (p, dispatch::aim(unit, bundle, &bundle.span, &p.place)));
    let met: Vec<(&Part<'_>, Packet)> = aimed.filter(|(_, packet)| packet.active != 0).collect();
    match met.as_slice() {
        [] => 0,
        [(part, packet)] => {
            dispatch::draw(unit, &part.job, packet, pixels, counts);
            packet.active
        }
        several => {
            rounds(several, |(part, packet), lanes| {
                let span = Span { active: lanes, ..packet.span() };
                dispatch::draw(unit, &part.job, &packet.within(&span), pixels, counts);
            });
            several.iter().fold(0, |all, (_, packet)| all | packet.active)
        }
    }
}

/// Visits every interval of every ray from front to back, those of several rays together where
/// they are next in the same packet.
fn rounds<'p, P>(packets: &'p [(P, Packet)], mut visit: impl FnMut(&'p (P, Packet), u32)) {
    let mut waiting: [Vec<usize>; LANES] = std::array::from_fn(|l| {
        let mut order: Vec<usize> = (0..packets.len()).filter(|&i| packets[i].1.active >> l & 1 == 1).collect();
        // Last comes first to be taken.
        order.sort_by(|&a, &b| packets[b].1.start[l].total_cmp(&packets[a].1.start[l]));
        order
    });
    while let Some(next) = waiting.iter().find_map(|order| order.last().copied()) {
        let mut lanes = 0;
        for (l, order) in waiting.iter_mut().enumerate() {
            if order.last() == Some(&next) {
                order.pop();
                lanes |= 1 << l;
            }
        }
        visit(&packets[next], lanes);
    }
}
