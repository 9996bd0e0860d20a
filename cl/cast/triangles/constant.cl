// Where triangles are read from: triangles in __constant memory.

#define SOURCE_SPACE __constant
#define STAGE_VERTICES 0
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
