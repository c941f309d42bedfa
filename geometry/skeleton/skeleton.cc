#include "geometry/skeleton/skeleton.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "core/some_of.h"
#include "core/text/words.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::geometry {
namespace {

std::vector<Skeleton> ParseAll() {
  std::vector<Skeleton> all;
  for (const internal::KnownSkeleton& known : internal::KnownSkeletons()) {
    all.push_back(SkeletonFromToml(known.toml, std::string(known.name) + ".toml"));
    MVS_CHECK(all.back().name == known.name, known.name << ".toml calls itself " << all.back().name);
  }
  return all;
}

const std::vector<Skeleton>& All() {
  static const std::vector<Skeleton> all = ParseAll();
  return all;
}

/// Pairs among the 70 points of a face, which have numbers for names.
const std::vector<std::pair<std::string, std::string>>& FaceMirror() {
  static const auto pairs = [] {
    const Skeleton& whole = SkeletonByName("openpose137");
    std::vector<std::pair<std::string, std::string>> names;
    for (const auto& [left, right] : whole.pairs) {
      const std::string& name = whole.joints[static_cast<size_t>(left)];
      if (name.rfind("Face", 0) == 0) names.emplace_back(name, whole.joints[static_cast<size_t>(right)]);
    }
    return names;
  }();
  return pairs;
}

/// What the joint `name` of the left side may be called on the right; empty when it names no left side.
std::vector<std::string> NamesOfRight(const std::string& name) {
  static const std::pair<const char*, const char*> kPrefixes[] = {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"},
                                                                  {"l_", "r_"},      {"L_", "R_"},      {"L", "R"}};
  static const std::pair<const char*, const char*> kSuffixes[] = {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"},
                                                                  {"_l", "_r"},      {"_L", "_R"},      {".l", ".r"},
                                                                  {".L", ".R"},      {" L", " R"},      {"-L", "-R"}};
  std::vector<std::string> names;
  for (const auto& [left, right] : kPrefixes) {
    if (name.rfind(left, 0) == 0) names.push_back(right + name.substr(std::string(left).size()));
  }
  for (const auto& [left, right] : kSuffixes) {
    const std::string end = left;
    if (name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0) {
      names.push_back(name.substr(0, name.size() - end.size()) + right);
    }
  }
  return names;
}

bool IsUpper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
bool IsLower(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }

/// Words of a name in small letters: "LBigToe" and "l_big_toe" are l, big, toe.
std::vector<std::string> WordsOf(const std::string& name) {
  std::vector<std::string> words(1);
  for (size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (std::string("_-. \t").find(c) != std::string::npos) {
      words.emplace_back();
      continue;
    }
    const bool begins = i > 0 && IsUpper(c) && (IsLower(name[i - 1]) || (i + 1 < name.size() && IsLower(name[i + 1])));
    if (begins) words.emplace_back();
    words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  words.erase(std::remove_if(words.begin(), words.end(), [](const std::string& word) { return word.empty(); }), words.end());
  return words;
}

/// "l" or "r" for a word that is a side; else empty.
std::string SideOf(const std::string& word) {
  if (word == "l" || word == "left") return "l";
  return word == "r" || word == "right" ? "r" : "";
}

/// Takes the side out of the words: at one end, or as the beginning of a word like "leftknee".
std::string TakeSide(std::vector<std::string>* words) {
  if (words->empty()) return "";
  if (words->size() > 1) {
    for (const bool front : {true, false}) {
      const std::string side = SideOf(front ? words->front() : words->back());
      if (side.empty()) continue;
      words->erase(front ? words->begin() : words->end() - 1);
      return side;
    }
  }
  for (const std::string side : {"left", "right"}) {
    std::string& first = words->front();
    if (first.size() <= side.size() || first.compare(0, side.size(), side) != 0) continue;
    first.erase(0, side.size());
    return side.substr(0, 1);
  }
  return "";
}

/// What COCO-WholeBody, Halpe and Panoptic call joints that have another word with OpenPose.
std::string OpenPoseWord(const std::string& part, bool has_side) {
  static const std::map<std::string, std::string> kMiddle = {
      {"bodycenter", "midhip"}, {"hip", "midhip"}, {"pelvis", "midhip"}, {"headtop", "head"}, {"tophead", "head"}};
  static const std::pair<const char*, const char*> kFingers[] = {{"forefinger", "index"},
                                                                 {"middlefinger", "middle"},
                                                                 {"ringfinger", "ring"},
                                                                 {"pinkyfinger", "pinky"},
                                                                 {"handroot", "handwrist"}};
  if (!has_side) {
    const auto found = kMiddle.find(part);
    return found == kMiddle.end() ? part : found->second;
  }
  for (const auto& [other, ours] : kFingers) {
    const std::string word = other;
    if (part.compare(0, word.size(), word) == 0) return ours + part.substr(word.size());
  }
  return part;
}

}  // namespace

int Skeleton::Find(const std::string& joint) const {
  const auto it = std::find(joints.begin(), joints.end(), joint);
  return it == joints.end() ? -1 : static_cast<int>(it - joints.begin());
}

std::vector<std::string> SkeletonNames() {
  std::vector<std::string> names;
  for (const internal::KnownSkeleton& known : internal::KnownSkeletons()) names.push_back(known.name);
  return names;
}

const Skeleton* FindSkeleton(const std::string& name) {
  const std::string key = SkeletonKey(name);
  for (const Skeleton& skeleton : All()) {
    if (skeleton.name == key) return &skeleton;
  }
  return nullptr;
}

const Skeleton& SkeletonByName(const std::string& name) {
  if (const Skeleton* found = FindSkeleton(name)) return *found;
  const std::string nearest = NearestWord(SkeletonKey(name), SkeletonNames());
  throw UsageError("unknown skeleton \"" + name + "\"" + (nearest.empty() ? "" : "; did you mean " + nearest + "?") +
                   "; known are " + Join(SkeletonNames(), ", ") + "; one of your own is a file FILE.toml (docs/formats.md)");
}

bool IsSkeletonFile(const std::string& name_or_file) {
  const std::string extension = std::filesystem::path(name_or_file).extension().string();
  return extension == ".toml" || extension == ".json" || name_or_file.find('/') != std::string::npos;
}

Skeleton SkeletonFrom(const std::string& name_or_file) {
  if (!IsSkeletonFile(name_or_file)) return SkeletonByName(name_or_file);
  RequireRegularFile(name_or_file);
  if (std::filesystem::file_size(name_or_file) > kMaxSkeletonBytes) {
    throw FormatError(name_or_file, "",
                      "is larger than 1 MiB; a skeleton has at most " + std::to_string(kMaxSkeletonJoints) + " joints");
  }
  const bool json = std::filesystem::path(name_or_file).extension() == ".json";
  Skeleton skeleton = json ? SkeletonFromJson(ReadFile(name_or_file), name_or_file, "")
                           : SkeletonFromToml(ReadFile(name_or_file), name_or_file);
  const Skeleton* known = FindSkeleton(skeleton.name);
  if (skeleton.name == PointsSkeleton({}).name || (known && known->name == skeleton.name && known->joints != skeleton.joints)) {
    throw FormatError(name_or_file, "name", "`" + skeleton.name + "` is the name of other joints; choose another");
  }
  return skeleton;
}

std::vector<std::string> SkeletonsOfSize(size_t num_joints) {
  std::vector<std::string> names;
  for (const Skeleton& skeleton : All()) {
    if (skeleton.joints.size() == num_joints) names.push_back(skeleton.name);
  }
  return names;
}

Skeleton PointsSkeleton(std::vector<std::string> joints) { return {"points", std::move(joints), {}}; }

bool HasJoints(const Skeleton& skeleton, const std::vector<std::string>& joints) {
  const auto known = [&skeleton](const std::string& joint) { return skeleton.Find(joint) >= 0; };
  return std::all_of(joints.begin(), joints.end(), known);
}

Skeleton SkeletonOrPoints(const std::string& name, const std::vector<std::string>& joints) {
  const Skeleton* known = FindSkeleton(name);
  return known && HasJoints(*known, joints) ? *known : PointsSkeleton(joints);
}

std::string BoneName(const Skeleton& skeleton, const std::pair<int, int>& bone) {
  return skeleton.joints[static_cast<size_t>(bone.first)] + "-" + skeleton.joints[static_cast<size_t>(bone.second)];
}

std::vector<std::array<uint8_t, 3>> BoneColours(const Skeleton& skeleton) {
  enum Side { kNeither, kLeft, kRight };
  constexpr std::array<uint8_t, 3> kBySide[] = {{255, 220, 60}, {255, 60, 60}, {60, 230, 60}};
  std::vector<Side> sides(skeleton.joints.size(), kNeither);
  for (const auto& [left, right] : MirrorJoints(skeleton)) {
    sides[static_cast<size_t>(left)] = kLeft, sides[static_cast<size_t>(right)] = kRight;
  }
  std::vector<std::array<uint8_t, 3>> colours;
  for (size_t b = 0; b < skeleton.bones.size(); ++b) {
    const Side from = sides[static_cast<size_t>(skeleton.bones[b].first)];
    const Side to = sides[static_cast<size_t>(skeleton.bones[b].second)];
    colours.push_back(kBySide[from == to ? from : kNeither]);
    if (skeleton.colours.empty() || skeleton.colours[b].empty()) continue;
    const unsigned long rgb = std::strtoul(skeleton.colours[b].c_str() + 1, nullptr, 16);
    for (size_t k = 0; k < 3; ++k) colours.back()[k] = static_cast<uint8_t>(rgb >> (16 - 8 * k));
  }
  return colours;
}

std::vector<int> SpanningTree(const Skeleton& skeleton, int root) {
  constexpr int kUnreached = -2;
  std::vector<std::vector<int>> neighbours(skeleton.joints.size());
  for (const auto& [a, b] : skeleton.bones) {
    neighbours[static_cast<size_t>(a)].push_back(b), neighbours[static_cast<size_t>(b)].push_back(a);
  }
  std::vector<int> parents(skeleton.joints.size(), kUnreached), order = {root};
  parents[static_cast<size_t>(root)] = -1;
  const auto reach = [&](size_t first) {
    for (size_t i = first; i < order.size(); ++i) {
      for (const int next : neighbours[static_cast<size_t>(order[i])]) {
        if (parents[static_cast<size_t>(next)] != kUnreached) continue;
        parents[static_cast<size_t>(next)] = order[i];
        order.push_back(next);
      }
    }
  };
  reach(0);
  for (size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] != kUnreached) continue;
    parents[j] = root;
    order.push_back(static_cast<int>(j));
    reach(order.size() - 1);
  }
  return parents;
}

std::vector<int> HierarchyOf(const Skeleton& skeleton) {
  if (!skeleton.parents.empty() || skeleton.joints.empty()) return skeleton.parents;
  std::vector<int> degree(skeleton.joints.size(), 0);
  for (const auto& [a, b] : skeleton.bones) ++degree[static_cast<size_t>(a)], ++degree[static_cast<size_t>(b)];
  return SpanningTree(skeleton, static_cast<int>(std::max_element(degree.begin(), degree.end()) - degree.begin()));
}

std::vector<std::pair<int, int>> MirrorJoints(const Skeleton& skeleton) {
  if (!skeleton.pairs.empty()) return skeleton.pairs;
  std::vector<std::pair<int, int>> pairs;
  for (size_t i = 0; i < skeleton.joints.size(); ++i) {
    for (const std::string& right : NamesOfRight(skeleton.joints[i])) {
      const int j = skeleton.Find(right);
      if (j < 0) continue;
      pairs.emplace_back(static_cast<int>(i), j);
      break;
    }
  }
  for (const auto& [left, right] : FaceMirror()) {
    const int i = skeleton.Find(left), j = skeleton.Find(right);
    if (i >= 0 && j >= 0) pairs.emplace_back(i, j);
  }
  return pairs;
}

std::vector<std::vector<std::pair<int, int>>> MirrorGroups(const Skeleton& skeleton) {
  static const std::vector<std::vector<std::string>> kWords = {
      {"eye", "ear", "mouth", "face"},
      {"shoulder", "elbow", "wrist", "hand", "thumb", "index", "middle", "ring", "pinky"},
      {"hip", "knee", "ankle", "toe", "heel", "foot"}};
  std::vector<std::vector<std::pair<int, int>>> groups(kWords.size() + 1);
  for (const auto& pair : MirrorJoints(skeleton)) {
    std::string name = skeleton.joints[pair.first];
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    const auto names_part = [&name](const std::string& word) { return name.find(word) != std::string::npos; };
    size_t g = kWords.size();  // from the feet up: a "foot index" is no finger
    while (g > 0 && !std::any_of(kWords[g - 1].begin(), kWords[g - 1].end(), names_part)) --g;
    groups[g > 0 ? g - 1 : kWords.size()].push_back(pair);
  }
  groups.erase(std::remove_if(groups.begin(), groups.end(), [](const auto& group) { return group.empty(); }), groups.end());
  return groups;
}

const Skeleton& Coco19() {
  static const Skeleton& coco19 = SkeletonByName("coco19");
  return coco19;
}

std::array<std::vector<int>, 19> Coco19From(const Skeleton& from) {
  // The Neck of a skeleton that also knows the top of the head lies above the shoulder line.
  const bool upper_neck = from.Find("Head") >= 0;
  const auto mean_of = [&from](const char* left, const char* right) {
    const int i = from.Find(left), j = from.Find(right);
    return i >= 0 && j >= 0 ? std::vector<int>{i, j} : std::vector<int>{};
  };
  std::array<std::vector<int>, 19> sources;
  for (size_t k = 0; k < sources.size(); ++k) {
    const std::string& joint = Coco19().joints[k];
    const int own = joint == "Neck" && upper_neck ? -1 : from.Find(joint);
    if (own >= 0) {
      sources[k] = {own};
    } else if (joint == "Neck") {
      sources[k] = mean_of("LShoulder", "RShoulder");
    } else if (joint == "MidHip") {
      sources[k] = mean_of("LHip", "RHip");
    }
  }
  return sources;
}

std::string JointKey(const std::string& name) {
  std::vector<std::string> words = WordsOf(name);
  const std::string side = TakeSide(&words);
  std::string part;
  for (const std::string& word : words) part += word;
  return side + OpenPoseWord(part, !side.empty());
}

int FindJoint(const Skeleton& skeleton, const std::string& name) {
  const int exact = skeleton.Find(name);
  if (exact >= 0) return exact;
  int found = -1;
  const std::string key = JointKey(name);
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    if (JointKey(skeleton.joints[j]) != key) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(j);
  }
  return found;
}

std::string UnknownJoint(const Skeleton& skeleton, const std::string& name) {
  constexpr size_t kShown = 20;
  const std::string nearest = NearestWord(name, skeleton.joints);
  return "joint `" + name + "` is not in skeleton " + skeleton.name +
         (nearest.empty() ? ": its" : "; did you mean `" + nearest + "`? Its") + " joints are " +
         SomeOf(skeleton.joints, kShown);
}

std::string TwiceTheSameJoint(const Skeleton& skeleton, const std::vector<std::string>& names) {
  std::map<int, std::string> seen;
  for (const std::string& name : names) {
    const int joint = FindJoint(skeleton, name);
    if (joint < 0) continue;
    const auto [known, is_new] = seen.emplace(joint, name);
    if (!is_new && known->second != name) return "`" + known->second + "` and `" + name + "`";
  }
  return "";
}

std::string SkeletonKey(const std::string& name) {
  std::string key;
  for (const char c : name) {
    if (std::string("_-. \t").find(c) == std::string::npos)
      key += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return key;
}

}  // namespace mvstudio::geometry
