#include "body/skeleton.h"

#include <algorithm>
#include <cctype>

#include "body/skeleton_parts.h"
#include "core/check.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::body {
namespace {

using NamePairs = std::vector<std::pair<std::string, std::string>>;

const NamePairs kFace = {{"Nose", "LEye"}, {"LEye", "LEar"}, {"Nose", "REye"}, {"REye", "REar"}};
const NamePairs kArms = {{"LShoulder", "LElbow"}, {"LElbow", "LWrist"}, {"RShoulder", "RElbow"}, {"RElbow", "RWrist"}};
const NamePairs kLegs = {{"LHip", "LKnee"}, {"LKnee", "LAnkle"}, {"RHip", "RKnee"}, {"RKnee", "RAnkle"}};
const NamePairs kFeet = {{"LAnkle", "LBigToe"}, {"LBigToe", "LSmallToe"}, {"LAnkle", "LHeel"},
                         {"RAnkle", "RBigToe"}, {"RBigToe", "RSmallToe"}, {"RAnkle", "RHeel"}};
const NamePairs kNeckToHead = {{"Neck", "Nose"}, {"Neck", "LShoulder"}, {"Neck", "RShoulder"}};
const NamePairs kNeckToHips = {{"Neck", "LHip"}, {"Neck", "RHip"}};
const NamePairs kMidHip = {{"Neck", "MidHip"}, {"MidHip", "LHip"}, {"MidHip", "RHip"}};
const NamePairs kBox = {{"LShoulder", "RShoulder"}, {"LShoulder", "LHip"}, {"RShoulder", "RHip"}, {"LHip", "RHip"}};
const NamePairs kUpperNeck = {{"LShoulder", "Neck"}, {"RShoulder", "Neck"}, {"Neck", "Head"}, {"Neck", "Nose"}};

void AddBones(const NamePairs& group, Skeleton* skeleton) {
  for (const auto& [a, b] : group) {
    const int i = skeleton->Find(a), j = skeleton->Find(b);
    MVS_CHECK(i >= 0 && j >= 0, "skeleton " << skeleton->name << " has no bone " << a << "-" << b);
    skeleton->bones.emplace_back(i, j);
  }
}

Skeleton MakeSkeleton(const std::string& name, std::vector<std::string> joints, const std::vector<NamePairs>& groups) {
  Skeleton skeleton{name, std::move(joints), {}};
  for (const NamePairs& group : groups) AddBones(group, &skeleton);
  return skeleton;
}

Skeleton MakeCoco17(const std::string& name) {
  return MakeSkeleton(name,
                      {"Nose", "LEye", "REye", "LEar", "REar", "LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist",
                       "LHip", "RHip", "LKnee", "RKnee", "LAnkle", "RAnkle"},
                      {kBox, kArms, kLegs, kFace});
}

Skeleton MakeBody25b(const std::string& name) {
  return MakeSkeleton(name, {"Nose",   "LEye",    "REye",      "LEar",  "REar",    "LShoulder", "RShoulder", "LElbow", "RElbow",
                             "LWrist", "RWrist",  "LHip",      "RHip",  "LKnee",   "RKnee",     "LAnkle",    "RAnkle", "Neck",
                             "Head",   "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel"},
                      {kUpperNeck, kBox, kArms, kLegs, kFace, kFeet});
}

Skeleton MakeHalpe26(const std::string& name) {
  return MakeSkeleton(name,
                      {"Nose",   "LEye",   "REye",    "LEar",    "REar",      "LShoulder", "RShoulder", "LElbow", "RElbow",
                       "LWrist", "RWrist", "LHip",    "RHip",    "LKnee",     "RKnee",     "LAnkle",    "RAnkle", "Head",
                       "Neck",   "MidHip", "LBigToe", "RBigToe", "LSmallToe", "RSmallToe", "LHeel",     "RHeel"},
                      {kUpperNeck, kMidHip, kArms, kLegs, kFace, kFeet});
}

Skeleton MakeMediapipe33(const std::string& name) {
  const NamePairs head = {{"Nose", "LEyeInner"}, {"LEyeInner", "LEye"}, {"LEye", "LEyeOuter"},
                          {"LEyeOuter", "LEar"}, {"Nose", "REyeInner"}, {"REyeInner", "REye"},
                          {"REye", "REyeOuter"}, {"REyeOuter", "REar"}, {"LMouth", "RMouth"}};
  const NamePairs hands = {{"LWrist", "LPinky"}, {"LWrist", "LIndex"}, {"LWrist", "LThumb"}, {"LPinky", "LIndex"},
                           {"RWrist", "RPinky"}, {"RWrist", "RIndex"}, {"RWrist", "RThumb"}, {"RPinky", "RIndex"}};
  const NamePairs feet = {{"LAnkle", "LHeel"}, {"LHeel", "LFootIndex"}, {"LAnkle", "LFootIndex"},
                          {"RAnkle", "RHeel"}, {"RHeel", "RFootIndex"}, {"RAnkle", "RFootIndex"}};
  return MakeSkeleton(
      name, {"Nose",   "LEyeInner", "LEye",      "LEyeOuter", "REyeInner",  "REye",      "REyeOuter", "LEar",   "REar",
             "LMouth", "RMouth",    "LShoulder", "RShoulder", "LElbow",     "RElbow",    "LWrist",    "RWrist", "LPinky",
             "RPinky", "LIndex",    "RIndex",    "LThumb",    "RThumb",     "LHip",      "RHip",      "LKnee",  "RKnee",
             "LAnkle", "RAnkle",    "LHeel",     "RHeel",     "LFootIndex", "RFootIndex"},
      {head, hands, kBox, kArms, kLegs, feet});
}

Skeleton WithHands(Skeleton skeleton, bool with_wrists = true) {
  AppendHand("L", with_wrists, &skeleton);
  AppendHand("R", with_wrists, &skeleton);
  return skeleton;
}

Skeleton WithFace(Skeleton skeleton, int num_points) {
  AppendFace(num_points, &skeleton);
  return skeleton;
}

Skeleton MakeCoco133() {
  Skeleton skeleton = MakeCoco17("coco133");
  skeleton.joints.insert(skeleton.joints.end(), {"LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel"});
  AddBones(kFeet, &skeleton);
  return WithHands(WithFace(std::move(skeleton), 68));
}

/// An OpenPose body with its other lists of keypoints.
Skeleton WithParts(const Skeleton& body, bool face, bool hands, const std::string& name) {
  using Kind = SkeletonPart::Kind;
  Skeleton skeleton = body;
  skeleton.name = name;
  const auto size = [&skeleton] { return static_cast<int>(skeleton.joints.size()); };
  skeleton.parts = {{Kind::kBody, 0, size()}};
  const auto close = [&](Kind kind, int first) { skeleton.parts.push_back({kind, first, size() - first}); };
  int first = size();
  if (face) AppendFace(70, &skeleton), close(Kind::kFace, first);
  if (!hands) return skeleton;
  first = size(), AppendHand("L", true, &skeleton), close(Kind::kLeftHand, first);
  first = size(), AppendHand("R", true, &skeleton), close(Kind::kRightHand, first);
  return skeleton;
}

// Orders: OpenPose's poseParameters.cpp (BODY_25, BODY_25B, BODY_135, COCO), COCO's and COCO-WholeBody's keypoint order, the
// tables of Halpe-FullBody and MediaPipe, CMU Panoptic's joints19.
std::vector<Skeleton> MakeAll() {
  const Skeleton body25 =
      MakeSkeleton("body25", {"Nose", "Neck",    "RShoulder", "RElbow", "RWrist",  "LShoulder", "LElbow", "LWrist", "MidHip",
                              "RHip", "RKnee",   "RAnkle",    "LHip",   "LKnee",   "LAnkle",    "REye",   "LEye",   "REar",
                              "LEar", "LBigToe", "LSmallToe", "LHeel",  "RBigToe", "RSmallToe", "RHeel"},
                   {kNeckToHead, kMidHip, kArms, kLegs, kFace, kFeet});
  const Skeleton coco18 = MakeSkeleton("coco18",
                                       {"Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist",
                                        "RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar"},
                                       {kNeckToHead, kNeckToHips, kArms, kLegs, kFace});
  const Skeleton coco19 =
      MakeSkeleton("coco19",
                   {"Neck", "Nose", "MidHip", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle", "RShoulder", "RElbow",
                    "RWrist", "RHip", "RKnee", "RAnkle", "LEye", "LEar", "REye", "REar"},
                   {kNeckToHead, kMidHip, kArms, kLegs, kFace});
  const Skeleton body25b = MakeBody25b("body25b");
  std::vector<Skeleton> all = {body25,
                               body25b,
                               WithFace(WithHands(MakeBody25b("body135"), false), 70),
                               MakeCoco17("coco17"),
                               coco18,
                               coco19,
                               MakeCoco133(),
                               MakeHalpe26("halpe26"),
                               WithHands(WithFace(MakeHalpe26("halpe136"), 68)),
                               MakeMediapipe33("mediapipe33"),
                               WithHands(MakeMediapipe33("mediapipe75")),
                               WithParts(body25, true, true, "openpose137")};
  for (const Skeleton& body : {body25, body25b, coco18}) {
    all.push_back(WithParts(body, true, false, body.name + "+face"));
    all.push_back(WithParts(body, false, true, body.name + "+hands"));
    all.push_back(WithParts(body, true, true, body.name + "+face+hands"));
  }
  return all;
}

const std::vector<Skeleton>& All() {
  static const std::vector<Skeleton> all = MakeAll();
  return all;
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

}  // namespace

int Skeleton::Find(const std::string& joint) const {
  const auto it = std::find(joints.begin(), joints.end(), joint);
  return it == joints.end() ? -1 : static_cast<int>(it - joints.begin());
}

std::vector<std::string> SkeletonNames() {
  std::vector<std::string> names;
  for (const Skeleton& skeleton : All()) names.push_back(skeleton.name);
  return names;
}

const Skeleton& SkeletonByName(const std::string& name) {
  for (const Skeleton& skeleton : All()) {
    if (skeleton.name == name) return skeleton;
  }
  throw UsageError("unknown skeleton \"" + name + "\"; known are " + Join(SkeletonNames(), ", "));
}

std::vector<std::string> SkeletonsOfSize(size_t num_joints) {
  std::vector<std::string> names;
  for (const Skeleton& skeleton : All()) {
    if (skeleton.joints.size() == num_joints) names.push_back(skeleton.name);
  }
  return names;
}

Skeleton PointsSkeleton(std::vector<std::string> joints) { return {"points", std::move(joints), {}}; }

Skeleton SkeletonOrPoints(const std::string& name, const std::vector<std::string>& joints) {
  for (const Skeleton& skeleton : All()) {
    const auto known = [&skeleton](const std::string& joint) { return skeleton.Find(joint) >= 0; };
    if (skeleton.name == name && std::all_of(joints.begin(), joints.end(), known)) return skeleton;
  }
  return PointsSkeleton(joints);
}

std::vector<std::pair<int, int>> MirrorJoints(const Skeleton& skeleton) {
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
    const int i = skeleton.Find("Face" + std::to_string(left)), j = skeleton.Find("Face" + std::to_string(right));
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

}  // namespace mvstudio::body
