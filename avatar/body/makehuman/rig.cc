#include "avatar/body/makehuman/rig.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/json_tree.h"
#include "core/json_view.h"

namespace mvstudio::body {
namespace {

using RigJson = nlohmann::ordered_json;
using RigView = BasicJsonView<RigJson>;

RigJson ParseTree(const std::string& text, const std::string& path) {
  RigJson json;
  const JsonProblem problem = ParseJsonTree(text, {16, true}, &json);
  if (problem.kind == JsonProblem::Kind::kTwice)
    throw FormatError(path, problem.where, "key '" + problem.key + "' is there twice");
  if (problem.kind != JsonProblem::Kind::kNone)
    throw FormatError(path, "byte " + std::to_string(problem.byte), "is not valid JSON; cut short or damaged?");
  return json;
}

int VertexOf(const RigView& json, Eigen::Index num_vertices) {
  const int vertex = json.Int();
  if (vertex < 0 || vertex >= num_vertices) json.Fail("must be a vertex, less than " + std::to_string(num_vertices));
  return vertex;
}

PointRule ParsePoint(const RigView& json, const ObjMesh& mesh) {
  const std::string strategy = json["strategy"].Text();
  if (strategy == "CUBE") {
    const std::string group = json["cube_name"].Text();
    if (mesh.faces.count(group) == 0) json["cube_name"].Fail("the mesh has no group '" + group + "'");
    return MeanRule(GroupVertices(mesh, group, json.path()));
  }
  if (strategy == "VERTEX") return MeanRule({VertexOf(json["vertex_index"], mesh.vertices.cols())});
  if (strategy != "MEAN") json["strategy"].Fail("'" + strategy + "' is not CUBE, MEAN or VERTEX");
  const RigView list = json["vertex_indices"];
  if (list.ArraySize() == 0) list.Fail("is empty");
  std::vector<int> vertices;
  for (size_t i = 0; i < list.ArraySize(); ++i) vertices.push_back(VertexOf(list[i], mesh.vertices.cols()));
  return MeanRule(vertices);
}

/// Names so that parents come first.
std::vector<std::string> OrderBones(const RigView& bones) {
  std::vector<std::string> order;
  std::map<std::string, std::vector<std::string>> children;
  for (const auto& [name, value] : bones.value().items()) {
    if (name.empty()) bones.Fail("a bone has no name");  // such is the parent of the root
    const std::string parent = bones.Entry(name, value)["parent"].Text();
    if (!parent.empty() && !bones.Has(parent.c_str())) bones.Entry(name, value)["parent"].Fail("there is no such bone");
    children[parent].push_back(name);
  }
  std::vector<std::string> open = children[""];
  std::reverse(open.begin(), open.end());
  while (!open.empty()) {
    order.push_back(open.back());
    open.pop_back();
    const std::vector<std::string>& below = children[order.back()];
    open.insert(open.end(), below.rbegin(), below.rend());
  }
  if (order.size() != bones.value().size()) bones.Fail("a bone is its own ancestor");
  return order;
}

}  // namespace

int MakeHumanRig::Find(const std::string& name) const {
  const auto found = std::find_if(bones.begin(), bones.end(), [&](const Bone& bone) { return bone.name == name; });
  return found == bones.end() ? -1 : static_cast<int>(found - bones.begin());
}

MakeHumanRig ParseRig(const std::string& json, const std::string& path, const ObjMesh& mesh) {
  const RigJson tree = ParseTree(json, path);
  const RigView root(path, tree), bones = root.Has("bones") ? root["bones"] : root;
  if (!bones.value().is_object()) bones.Fail("must be an object of bones");
  MakeHumanRig rig;
  for (const std::string& name : OrderBones(bones)) {
    const RigView bone = bones[name.c_str()];
    rig.bones.push_back(
        {name, rig.Find(bone["parent"].Text()), ParsePoint(bone["head"], mesh), ParsePoint(bone["tail"], mesh)});
  }
  return rig;
}

std::vector<std::vector<std::pair<int, double>>> ParseRigWeights(const std::string& json, const std::string& path,
                                                                 const MakeHumanRig& rig, int num_vertices) {
  const RigJson tree = ParseTree(json, path);
  const RigView root(path, tree), bones = root["weights"];
  if (!bones.value().is_object()) bones.Fail("must be an object of bones");
  std::vector<std::vector<std::pair<int, double>>> weights(static_cast<size_t>(num_vertices));
  for (const auto& [name, value] : bones.value().items()) {
    const RigView list = bones.Entry(name, value);
    const int bone = rig.Find(name);
    if (bone < 0 && list.ArraySize() > 0) list.Fail("the rig has no such bone");
    for (size_t i = 0; i < list.ArraySize(); ++i) {
      const RigView pair = list[i];
      if (pair.ArraySize() != 2) pair.Fail("must be a vertex and its weight");
      const double weight = pair[1].Number();
      if (weight < 0 || weight > 1) pair[1].Fail("must be from 0 to 1");
      weights[static_cast<size_t>(VertexOf(pair[size_t{0}], num_vertices))].emplace_back(bone, weight);
    }
  }
  return weights;
}

}  // namespace mvstudio::body
