// meaning: global memory
// read_from: global
// copied: nothing

#define SOURCE_SPACE __global
#define STAGE_VERTICES 0
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
