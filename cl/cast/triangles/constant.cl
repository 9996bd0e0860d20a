// meaning: __constant memory
// read_from: constant
// copied: nothing

#define SOURCE_SPACE __constant
#define STAGE_VERTICES 0
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
