// Which of many lanes this one is: workgroups lie in rows, because a row cannot hold them all.
fn lane_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * RAYS + id.x;
}
