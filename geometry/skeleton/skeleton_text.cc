#include "geometry/skeleton/skeleton_text.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "core/join.h"
#include "core/json_view.h"
#include "core/label.h"
#include "core/some_of.h"
#include "core/toml_depth.h"

namespace mvstudio::geometry {
namespace {

using Json = nlohmann::ordered_json;
using View = BasicJsonView<Json>;

const std::vector<std::string> kKeys = {"name",  "human", "joints",  "bones",  "pairs",
                                        "parts", "root",  "parents", "rest_m", "up"};
const std::vector<std::pair<std::string, SkeletonPart::Kind>> kPartKinds = {{"body", SkeletonPart::Kind::kBody},
                                                                            {"face", SkeletonPart::Kind::kFace},
                                                                            {"left-hand", SkeletonPart::Kind::kLeftHand},
                                                                            {"right-hand", SkeletonPart::Kind::kRightHand}};

Json ToJson(const toml::node& node, const std::string& path) {
  if (const toml::table* table = node.as_table()) {
    Json object = Json::object();
    for (const auto& [key, value] : *table) object[std::string(key.str())] = ToJson(value, path);
    return object;
  }
  if (const toml::array* array = node.as_array()) {
    Json list = Json::array();
    for (const toml::node& value : *array) list.push_back(ToJson(value, path));
    return list;
  }
  if (const auto text = node.value_exact<std::string>()) return *text;
  if (const auto flag = node.value_exact<bool>()) return *flag;
  if (const auto whole = node.value_exact<int64_t>()) return *whole;
  if (const auto number = node.value_exact<double>()) return *number;
  throw FormatError(path, "line " + std::to_string(node.source().begin.line), "a date or time, which no key takes");
}

Json JsonOfToml(const std::string& text, const std::string& path) {
  RequireParsableToml(text, path);
  try {
    return ToJson(toml::parse(text), path);
  } catch (const toml::parse_error& error) {
    const auto at = error.source().begin;
    throw FormatError(path, "line " + std::to_string(at.line) + ", column " + std::to_string(at.column),
                      std::string(error.description()));
  }
}

std::string Quoted(const std::string& text) { return JsonQuoted<Json>(text); }

/// Finds joints by name.
class Joints {
 public:
  Joints(const View& list, Skeleton* skeleton) {
    const size_t count = list.ArraySize();
    if (count == 0) list.Fail("names no joint");
    if (count > kMaxSkeletonJoints) {
      list.Fail("names " + std::to_string(count) + " joints; at most " + std::to_string(kMaxSkeletonJoints) + " are taken");
    }
    for (size_t i = 0; i < count; ++i) {
      const std::string name = list[i].Text(), why = WhyNotALabel(name);
      if (!why.empty()) list[i].Fail(why + ": it cannot be a joint's name");
      if (!index_.emplace(name, static_cast<int>(i)).second) list[i].Fail(Quoted(name) + " is there twice");
      skeleton->joints.push_back(name);
    }
  }

  int At(const View& name) const {
    const auto found = index_.find(name.Text());
    if (found == index_.end()) name.Fail(Quoted(name.Text()) + " is none of the joints" + Suggestion(name.Text()));
    return found->second;
  }

  /// Two different joints.
  std::pair<int, int> Pair(const View& list) const {
    if (list.ArraySize() != 2) list.Fail("must be two joints");
    const std::pair<int, int> pair(At(list[size_t{0}]), At(list[1]));
    if (pair.first == pair.second) list.Fail("is twice the same joint");
    return pair;
  }

  std::vector<int> List(const View& list) const {
    std::vector<int> joints;
    for (size_t i = 0; i < list.ArraySize(); ++i) joints.push_back(At(list[i]));
    if (joints.empty()) list.Fail("names no joint");
    return joints;
  }

 private:
  /// The joint whose name begins most alike, by three letters at least.
  std::string Suggestion(const std::string& word) const {
    size_t most = 2;
    std::string nearest;
    for (const auto& [joint, index] : index_) {
      const auto differs = std::mismatch(word.begin(), word.end(), joint.begin(), joint.end());
      const auto alike = static_cast<size_t>(differs.first - word.begin());
      if (alike > most) most = alike, nearest = joint;
    }
    return nearest.empty() ? "" : "; did you mean " + Quoted(nearest) + "?";
  }

  std::map<std::string, int> index_;
};

void ReadName(const View& view, Skeleton* skeleton) {
  constexpr size_t kLongest = 64;
  skeleton->name = view.Text();
  const auto plain = [](unsigned char c) { return (c < 128 && std::isalnum(c)) || c == '_' || c == '-' || c == '+'; };
  const std::string& name = skeleton->name;
  if (name.empty() || name.size() > kLongest || !std::all_of(name.begin(), name.end(), plain)) {
    view.Fail(Quoted(name) + ": letters, digits, _, - and +, at most 64, make a name: files are called after it");
  }
}

LengthRange ReadRange(const View& view) {
  if (view.ArraySize() != 2) view.Fail("must be [shortest, longest] in metres");
  const LengthRange range{view[size_t{0}].Number(), view[1].Number()};
  if (!(range.min_m >= 0) || !(range.max_m > range.min_m)) {
    view.Fail("must be [shortest, longest] in metres, 0 or more and the second larger");
  }
  return range;
}

std::string ReadColour(const View& view) {
  const std::string text = view.Text();
  const auto hex = [](unsigned char c) { return std::isxdigit(c) != 0; };
  if (text.size() != 7 || text[0] != '#' || !std::all_of(text.begin() + 1, text.end(), hex)) {
    view.Fail(Quoted(text) + " is no colour such as \"#ff8800\"");
  }
  return text;
}

void RequireKnown(const View& view, const std::vector<std::string>& keys) {
  for (const auto& [key, value] : view.value().items()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      view.Entry(key, value).Fail("is no key here; known are " + Join(keys, ", "));
    }
  }
}

/// A bone: two names, or a table with them, a range of lengths and a colour.
void ReadBone(const View& view, const Joints& joints, Skeleton* skeleton) {
  const bool plain = view.value().is_array();
  if (!plain && !view.value().is_object()) view.Fail("must be two joints, or a table with `joints`");
  if (!plain) RequireKnown(view, {"joints", "length_m", "colour"});
  skeleton->bones.push_back(joints.Pair(plain ? view : view["joints"]));
  skeleton->lengths.push_back(view.Has("length_m") ? ReadRange(view["length_m"]) : LengthRange());
  skeleton->colours.push_back(view.Has("colour") ? ReadColour(view["colour"]) : "");
}

void ReadBones(const View& list, const Joints& joints, Skeleton* skeleton) {
  constexpr size_t kMostBones = 10 * kMaxSkeletonJoints;
  std::set<std::pair<int, int>> seen;
  if (list.ArraySize() > kMostBones) list.Fail("names more than " + std::to_string(kMostBones) + " bones");
  for (size_t i = 0; i < list.ArraySize(); ++i) {
    ReadBone(list[i], joints, skeleton);
    if (!seen.insert(std::minmax(skeleton->bones.back().first, skeleton->bones.back().second)).second) {
      list[i].Fail("bone " + BoneName(*skeleton, skeleton->bones.back()) + " is there twice");
    }
  }
  const auto unlimited = [](const LengthRange& range) { return range.min_m == 0 && std::isinf(range.max_m); };
  if (std::all_of(skeleton->lengths.begin(), skeleton->lengths.end(), unlimited)) skeleton->lengths.clear();
  const auto none = [](const std::string& colour) { return colour.empty(); };
  if (std::all_of(skeleton->colours.begin(), skeleton->colours.end(), none)) skeleton->colours.clear();
}

void ReadPairs(const View& list, const Joints& joints, Skeleton* skeleton) {
  std::set<int> seen;
  for (size_t i = 0; i < list.ArraySize(); ++i) {
    const auto [left, right] = joints.Pair(list[i]);
    for (const int joint : {left, right}) {
      if (!seen.insert(joint).second) list[i].Fail(Quoted(skeleton->joints[static_cast<size_t>(joint)]) + " is in two pairs");
    }
    skeleton->pairs.emplace_back(left, right);
  }
}

void ReadParts(const View& list, Skeleton* skeleton) {
  size_t next = 0;
  for (size_t i = 0; i < list.ArraySize(); ++i) {
    RequireKnown(list[i], {"kind", "count"});
    const View kind = list[i]["kind"];
    const auto found =
        std::find_if(kPartKinds.begin(), kPartKinds.end(), [&](const auto& k) { return k.first == kind.Text(); });
    if (found == kPartKinds.end()) kind.Fail("is none of body, face, left-hand, right-hand");
    const int count = list[i]["count"].PlainInt();
    if (count < 1 || static_cast<size_t>(count) > skeleton->joints.size() - next) {
      list[i]["count"].Fail("is more than the joints that are left");
    }
    skeleton->parts.push_back({found->second, static_cast<int>(next), count});
    next += static_cast<size_t>(count);
  }
  if (next != skeleton->joints.size()) list.Fail("hold " + std::to_string(next) + " joints, not all of them");
}

/// Fails unless parents lead from every joint to one root.
void RequireTree(const View& view, const Skeleton& skeleton) {
  std::vector<std::string> roots;
  for (size_t j = 0; j < skeleton.parents.size(); ++j) {
    if (skeleton.parents[j] < 0) roots.push_back(skeleton.joints[j]);
  }
  if (roots.size() > 1) view.Fail("all joints but one have a parent; these have none: " + SomeOf(roots));
  for (size_t j = 0; j < skeleton.parents.size(); ++j) {
    int at = static_cast<int>(j);
    size_t steps = 0;
    while (at >= 0 && steps <= skeleton.parents.size()) at = skeleton.parents[static_cast<size_t>(at)], ++steps;
    if (at >= 0) view.Fail("the parents of " + Quoted(skeleton.joints[j]) + " go in a circle");
  }
}

void ReadHierarchy(const View& view, const Joints& joints, Skeleton* skeleton) {
  if (view.Has("root") && view.Has("parents")) view["root"].Fail("give either `root` or `parents`");
  if (view.Has("root")) skeleton->parents = SpanningTree(*skeleton, joints.At(view["root"]));
  if (!view.Has("parents")) return;
  const View table = view["parents"];
  if (!table.value().is_object()) table.Fail("must be a table: joint = \"parent\"");
  skeleton->parents.assign(skeleton->joints.size(), -1);
  for (const auto& [child, parent] : table.value().items()) {
    const Json name(child);
    const int joint = joints.At(View(table.path(), name, table.where()));
    skeleton->parents[static_cast<size_t>(joint)] = joints.At(table.Entry(child, parent));
  }
  RequireTree(table, *skeleton);
}

void ReadRest(const View& table, const Joints& joints, Skeleton* skeleton) {
  if (!table.value().is_object()) table.Fail("must be a table: joint = [x, y, z]");
  if (skeleton->parents.empty()) table.Fail("needs `root` or `parents`");
  std::set<int> given;
  skeleton->rest_m.assign(skeleton->joints.size(), {0, 0, 0});
  for (const auto& [name, offset] : table.value().items()) {
    const Json text(name);
    const int joint = joints.At(View(table.path(), text, table.where()));
    const View entry = table.Entry(name, offset);
    if (entry.ArraySize() != 3) entry.Fail("must be [x, y, z] in metres");
    for (size_t k = 0; k < 3; ++k) skeleton->rest_m[static_cast<size_t>(joint)][k] = entry[k].Number();
    given.insert(joint);
  }
  std::vector<std::string> lacking;
  for (size_t j = 0; j < skeleton->joints.size(); ++j) {
    if (skeleton->parents[j] >= 0 && !given.count(static_cast<int>(j))) lacking.push_back(skeleton->joints[j]);
  }
  if (!lacking.empty()) table.Fail("lacks " + SomeOf(lacking));
}

Skeleton ReadSkeleton(const View& view) {
  if (!view.value().is_object()) view.Fail("must be a table");
  RequireKnown(view, kKeys);
  Skeleton skeleton;
  ReadName(view["name"], &skeleton);
  const Joints joints(view["joints"], &skeleton);
  if (view.Has("bones")) ReadBones(view["bones"], joints, &skeleton);
  if (view.Has("pairs")) ReadPairs(view["pairs"], joints, &skeleton);
  if (view.Has("parts")) ReadParts(view["parts"], &skeleton);
  ReadHierarchy(view, joints, &skeleton);
  if (view.Has("rest_m")) ReadRest(view["rest_m"], joints, &skeleton);
  if (view.Has("up")) {
    RequireKnown(view["up"], {"from", "to"});
    skeleton.up_from = joints.List(view["up"]["from"]), skeleton.up_to = joints.List(view["up"]["to"]);
  }
  if (view.Has("human")) skeleton.human = view["human"].Flag();
  return skeleton;
}

Json NamesOf(const Skeleton& skeleton, const std::vector<int>& joints) {
  Json list = Json::array();
  for (const int joint : joints) list.push_back(skeleton.joints[static_cast<size_t>(joint)]);
  return list;
}

Json BonesOf(const Skeleton& skeleton) {
  Json list = Json::array();
  for (size_t b = 0; b < skeleton.bones.size(); ++b) {
    const Json ends = NamesOf(skeleton, {skeleton.bones[b].first, skeleton.bones[b].second});
    Json bone = {{"joints", ends}};
    if (!skeleton.lengths.empty() && std::isfinite(skeleton.lengths[b].max_m)) {
      bone["length_m"] = {skeleton.lengths[b].min_m, skeleton.lengths[b].max_m};
    }
    if (!skeleton.colours.empty() && !skeleton.colours[b].empty()) bone["colour"] = skeleton.colours[b];
    list.push_back(bone.size() > 1 ? bone : ends);
  }
  return list;
}

void AddHierarchy(const Skeleton& skeleton, Json* json) {
  if (skeleton.parents.empty()) return;
  Json parents = Json::object(), rest = Json::object();
  for (size_t j = 0; j < skeleton.parents.size(); ++j) {
    if (skeleton.parents[j] < 0) continue;
    parents[skeleton.joints[j]] = skeleton.joints[static_cast<size_t>(skeleton.parents[j])];
    if (!skeleton.rest_m.empty()) rest[skeleton.joints[j]] = skeleton.rest_m[j];
  }
  (*json)["parents"] = parents;
  if (!skeleton.rest_m.empty()) (*json)["rest_m"] = rest;
}

}  // namespace

Skeleton SkeletonFromToml(const std::string& text, const std::string& path) {
  const Json json = JsonOfToml(text, path);
  return ReadSkeleton(View(path, json));
}

Skeleton SkeletonFromJson(const std::string& text, const std::string& path, const std::string& where) {
  const Json json = JsonFromText<Json>(text, JsonLimits(), path);
  return ReadSkeleton(View(path, json, where));
}

std::string SkeletonToJson(const Skeleton& skeleton) {
  Json json = {{"name", skeleton.name}, {"human", skeleton.human}, {"joints", skeleton.joints}, {"bones", BonesOf(skeleton)}};
  if (!skeleton.pairs.empty()) {
    Json& pairs = json["pairs"] = Json::array();
    for (const auto& [left, right] : skeleton.pairs) pairs.push_back(NamesOf(skeleton, {left, right}));
  }
  if (!skeleton.parts.empty()) {
    Json& parts = json["parts"] = Json::array();
    for (const SkeletonPart& part : skeleton.parts) {
      parts.push_back({{"kind", kPartKinds[static_cast<size_t>(part.kind)].first}, {"count", part.count}});
    }
  }
  AddHierarchy(skeleton, &json);
  if (!skeleton.up_from.empty()) {
    json["up"] = {{"from", NamesOf(skeleton, skeleton.up_from)}, {"to", NamesOf(skeleton, skeleton.up_to)}};
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace mvstudio::geometry
