// blend2: two volumes in one place.
//
// As overlapping shapes do: extinctions add, and the colour is their mean weighted by extinction
// (equal weights where both are opaque). The second volume counts only where it is. Extinction σ and
// emission σc of what is in one place add in the equation of transfer, dC = T·Σσc·ds and
// dT = −T·Σσ·ds (N. Max, "Optical models for direct volume rendering", IEEE TVCG 1(2), 1995, section 4).
fn shade(s: Sample) -> Medium {
    let a = lookup_table(volume(s.position));
    if !volume2_inside(s.position) { return a; }
    let b = lookup_table2(volume2(s.position));
    let sum = a.extinction + b.extinction;
    if sum == 0.0 { return a; }
    // Twice the same infinity: its parts are not numbers, and the mean is plain.
    if a.extinction == b.extinction { return Medium(0.5 * (a.color + b.color), sum); }
    if a.extinction == sum { return a; }
    if b.extinction == sum { return b; }
    return Medium((a.color * a.extinction + b.color * b.extinction) / sum, sum);
}
