// Where the table of log2 R_d over log2 of squared distances has a squared distance.

import package::units::{Number, Area};

// Its whole part is an entry that another follows; `last` is the table's last one.
fn log_entry(squared: Area, low: Number, steps: Number, last: u32) -> Number {
    return clamp((log2(max(squared, 1e-30)) - low) * steps, 0.0, f32(last) - 1e-3);
}
