// labels: a segmentation.
//
// The label of the nearest sample, through a table with a control point for each label. Labels are
// names: a label without a control point is not drawn, wherever it lies between or beyond others,
// and nothing is interpolated. Where a volume is given, too, its interpolated value through
// `value_table` multiplies colour and opacity. Labels are whole numbers up to 2^24, which single
// precision holds. A look of its own for each label of the nearest sample is after M. Hadwiger,
// C. Berger, H. Hauser, "High-quality two-level volume rendering of segmented data sets on consumer
// graphics hardware", IEEE Visualization 2003.
fn shade(s: Sample) -> Medium {
    let label = label_table_entry(round(labels_nearest(s.position)));
    if volume_given() {
        let value = value_table_color(volume(s.position));
        return medium(label.rgb * value.rgb, label.a * value.a);
    } else {
        return medium(label.rgb, label.a);
    }
}
