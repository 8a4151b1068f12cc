#include "common/round/task.h"

namespace glint {

Digest BakeKey(const std::string& execution, const Digest& scene, const BakeSettings& settings) {
  Hasher hasher;
  hasher.String("glint bake").String(execution).Add(scene);
  HashSettings(settings, &hasher);
  return hasher.Finish();
}

Digest TaskKey(const Digest& bake_key, int layer, const GatherBlock& block, const Digest& previous) {
  return Hasher()
      .String("task")
      .Add(bake_key)
      .Add(layer)
      .Add(block.first_vertex)
      .Add(block.vertices)
      .Add(block.first_column)
      .Add(block.columns)
      .Add(previous)
      .Finish();
}

}  // namespace glint
