// How groups lie in the layers of cells and of summed-area tables.
#ifndef ANTUMBRA_OCCLUSION_TEXTURES_TABLES_GLSL
#define ANTUMBRA_OCCLUSION_TEXTURES_TABLES_GLSL

// Bytes of a texel of the cells: group 4 i + b of its layer is byte b of component i.
const uint GROUPS_A_CELL = 16u;

// A table's texel holds the sums of 4 groups in its components; or (packed) those of 8, each in 16
// bits: groups 0 and 2, 1 and 3, 4 and 6, 5 and 7 share a component.
const uint GROUPS_A_TEXEL = 4u;
const uint GROUPS_A_PACKED_TEXEL = 8u;

#endif
