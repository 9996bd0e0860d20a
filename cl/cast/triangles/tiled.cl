// meaning: streamed through __local memory in tiles: any scene size
// read_from: global
// copied: rows

#define SOURCE_SPACE __global
#define STAGE_VERTICES 0
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 1
