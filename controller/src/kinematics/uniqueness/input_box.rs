//! A box of inputs: an interval for each slide and each leg.

use masseter_model::geometry::{AXES, LEGS};

use super::Enclosure;

/// Six intervals, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputBox {
    /// dᵢ.
    pub slide_m: [Enclosure; LEGS],
    /// lᵢ; must be positive.
    pub leg_m: [Enclosure; LEGS],
}

impl InputBox {
    /// The same interval for all slides, and one for all legs, metres.
    pub fn uniform(slide_m: [f64; 2], leg_m: [f64; 2]) -> Self {
        let interval = |[low, high]: [f64; 2]| Enclosure::new(low, high);
        Self { slide_m: [interval(slide_m); LEGS], leg_m: [interval(leg_m); LEGS] }
    }

    /// The intervals in the axis order d₁ d₂ d₃ l₁ l₂ l₃.
    pub fn axes(&self) -> [Enclosure; AXES] {
        let ([d1, d2, d3], [l1, l2, l3]) = (self.slide_m, self.leg_m);
        [d1, d2, d3, l1, l2, l3]
    }

    /// The two halves along the widest axis.
    pub fn halves(&self) -> [Self; 2] {
        let axes = self.axes();
        let widest = (0..AXES).fold(0, |a, b| if axes[b].width() > axes[a].width() { b } else { a });
        axes[widest].halves().map(|half| {
            let mut part = *self;
            let axis = if widest < LEGS { &mut part.slide_m[widest] } else { &mut part.leg_m[widest - LEGS] };
            *axis = half;
            part
        })
    }
}
