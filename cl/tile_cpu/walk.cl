// The traversal of the tree by the rays of a tile.

// An entry of the stack: a node or a leaf (its word), a lower bound of the t at which the tile's rays enter its box,
// and the vectors whose rays visit it, one bit each.
typedef struct {
    uint word;
    float entry;
    uint live;
} WaitingTile;

// Prefetches the first four cache lines of a child that will be visited soon. Four cache lines hold a whole node of
// eight children, the first rows of a node of 16 children, or the first triangles of a leaf. The cache lines are loaded
// while other children are tested.
static void fetch_child(const Tree *tree, uint word) {
    const __global float *at = IS_LEAF(word) ? tree->leaves + LEAF_ROW * (size_t)LEAF_FIRST(word)
                                             : tree->nodes + NODE_STRIDE * (size_t)word;
    FETCH(at), FETCH(at + 16), FETCH(at + 32), FETCH(at + 48);
}

// Pushes onto the stack those children of a node that a vector of rays in `live` meets. The nearest child is on top of
// the stack, unless `any` is 1 (then, the order of children does not matter). `reach` is the largest t at which a ray
// of the tile can hit something. Returns the new number of the stack's entries. Unless `any` is 1, the function finds a
// child's place in the stack by counting the pushed children that the tile enters later, since these lie below the
// child in the stack. An example with three children, entered at t = 5, 2 and 9:
//
//     5 has one child below it (9), 2 has two (9 and 5), 9 has none  ->  stack, from below: 9 5 2
int push_children(const Bundle *bundle, const Slices *slices, const TileInterval *interval, const SurfaceTree *tree,
                  uint word, uint live, float reach, const int any, WaitingTile *stack, int waiting) {
    const __global float *node = tree->tree.nodes + NODE_STRIDE * (size_t)word;
    Boxes boxes;
    uint vectors[NODE_WIDTH], pushed = 0;
    // First, the whole tile is tested against all children together. Then, the vectors of rays are tested child by
    // child.
    for (uint met = children_overlap(interval, bundle->origin, node, reach, &boxes); met; met &= met - 1) {
        const int child = LOWEST_BIT(met);
        vectors[child] = live & slices_overlap(slices, interval, &boxes, child);
        // The hits of a scattered vector of rays lie far apart, so the interval of its rays' directions is too wide to
        // exclude boxes. Each ray of a scattered vector is tested instead.
        const uint unsure = any ? vectors[child] & bundle->scattered : 0;
        if (unsure) vectors[child] = (vectors[child] & ~unsure) | rays_enter(bundle, &boxes, child, unsure);
        if (!vectors[child]) continue;
        fetch_child(&tree->tree, as_uint(node[CHILD_ROW + child]));
        pushed |= 1u << child;
    }
    for (uint left = pushed; left; left &= left - 1) {
        const int child = LOWEST_BIT(left);
        // A child's place is the number of children below it in the stack, so sorting needs no loop over pairs.
        const uint before = pushed & ((1u << child) - 1);
        const float entry = ((const float *)&boxes.entry)[child];
        const uint below =
            any ? before : (pushed & CHILD_BITS(boxes.entry > entry)) | (before & CHILD_BITS(boxes.entry == entry));
        WaitingTile *slot = stack + waiting + popcount(below);
        slot->word = as_uint(node[CHILD_ROW + child]);
        slot->entry = entry;
        slot->live = vectors[child];
    }
    return waiting + popcount(pushed);
}

// Traverses the tree with a tile's rays (the bundle). In `open`, a bit is set for each vector that has at least one
// ray. With `any`, the traversal ends as soon as every ray has a hit.
void walk(Bundle *bundle, Slices *slices, const TileInterval *interval, const SurfaceTree *tree, uint open,
          const int any) {
#if CUTOUTS
    bundle->tree = &tree->tree;
#endif
    WaitingTile stack[STACK_SIZE];
    // The stack's first entry is the tree's root, which every vector in `open` visits.
    stack[0].word = 0;
    stack[0].entry = 0.0f;
    stack[0].live = open;
    int waiting = 1;
    float reach = furthest(slices);
    while (waiting && open) {
        const WaitingTile next = stack[--waiting];
        // Leaves out vectors whose rays have all hit something nearer than `next` by now (with `any`: hit anything).
        const uint live = next.live & (any ? open : reaching(slices, next.entry));
        if (!live) continue;
        if (!IS_LEAF(next.word)) {
            waiting = push_children(bundle, slices, interval, tree, next.word, live, reach, any, stack, waiting);
            continue;
        }
        const uint changed = test_leaf(bundle, tree, next.word, live, any);
        // With `any`, a vector whose rays are all blocked is finished. Without `any`, a vector with new hits may now
        // have a smaller reach (largest t).
        if (any) {
            open &= ~changed;
        } else {
            update_reach(bundle, slices, changed);
            reach = furthest(slices);
        }
    }
}
