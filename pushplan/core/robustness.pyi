"""Contact conditions of perturbed chains at the moments of a motion."""

from pushplan.util.arrays import BoolArray, ComplexArray, FloatArray, IntArray

_Variants = tuple[  # a `robustness.Variants`
    FloatArray, FloatArray, IntArray, BoolArray, FloatArray, FloatArray, FloatArray, BoolArray
]
_Moments = tuple[FloatArray, FloatArray, FloatArray, IntArray]  # a `robustness.Moments`

def floor_wrenches(variants: _Variants, series: ComplexArray, directions: FloatArray) -> FloatArray:
    """Return the wrenches (m, n, 3) that move each object of the last variant against the floor at twists (m, 3)."""

def facet_values(
    variants: _Variants,
    series: ComplexArray,
    mass: FloatArray,
    moment: FloatArray,
    moments: _Moments,
    known: FloatArray,
) -> FloatArray:
    """Return the facets' values (q, m, n, 4) of the contacts of q variants at m moments, N and N m.

    Args:
        variants: The chains.
        series: Of the `PackedChain`.
        mass: (q, n) or (1, n), kg.
        moment: (q, n) or (1, n) moments of inertia, kg m^2.
        moments: When.
        known: (m, n, 3) wrenches that move the objects against the floor where that is not `changed`.
    """
