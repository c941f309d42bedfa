#include "body/names/joint_names.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "core/some_of.h"
#include "core/text/nearest_word.h"

namespace mvstudio::body {
namespace {

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
  words.erase(std::remove(words.begin(), words.end(), ""), words.end());
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

}  // namespace mvstudio::body
