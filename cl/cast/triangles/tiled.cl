// Where triangles are read from: what a test reads streamed through __local memory, TILE_TRIANGLES at a time: any scene size.

#define SOURCE_SPACE __global
#define STAGE_VERTICES 0
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 1
