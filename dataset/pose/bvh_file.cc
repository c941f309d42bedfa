#include "dataset/pose/bvh_file.h"

#include <cctype>
#include <cmath>
#include <cstdlib>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/units.h"

namespace mvstudio::dataset {
namespace {

constexpr int kMaxBvhJoints = 1024;
constexpr size_t kMaxBvhValues = size_t{1} << 28;

/// BvhWords of a file with the line they stand in.
class BvhWords {
 public:
  BvhWords(const std::string& text, const std::string& path) : text_(text), path_(path) {}

  bool Done() {
    Skip();
    return at_ >= text_.size();
  }
  std::string Next() {
    Skip();
    const size_t begin = at_;
    while (at_ < text_.size() && !std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    if (at_ == begin) Fail("ends too early: was it cut off?");
    return text_.substr(begin, at_ - begin);
  }
  /// The rest of the line, for names with spaces.
  std::string Line() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
    const size_t begin = at_;
    while (at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '\r') ++at_;
    size_t end = at_;
    while (end > begin && std::isspace(static_cast<unsigned char>(text_[end - 1]))) --end;
    return text_.substr(begin, end - begin);
  }
  void Expect(const std::string& word) {
    const std::string found = Next();
    const bool glued =
        word.back() == ':' && found.size() > word.size() && found.compare(0, word.size(), word) == 0;  // Frames:2
    if (glued) at_ -= found.size() - word.size();
    if (found != word && !glued) Fail("'" + found + "' where '" + word + "' should be");
  }
  double Number() {
    const std::string word = Next();
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (*end != '\0' || !std::isfinite(value)) Fail("'" + word + "' is not a number");
    return value;
  }
  int Count(int limit) {
    const double value = Number();
    if (!(value >= 0 && value <= limit) || value != std::floor(value))
      Fail("a count is not a whole number up to " + std::to_string(limit));
    return static_cast<int>(value);
  }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(path_, "line " + std::to_string(line_), what); }

 private:
  void Skip() {
    for (; at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])); ++at_) line_ += text_[at_] == '\n';
  }
  const std::string& text_;
  const std::string& path_;
  size_t at_ = 0;
  int line_ = 1;
};

Eigen::Vector3d ReadBvhOffset(BvhWords& words) {
  const double x = words.Number(), y = words.Number(), z = words.Number();
  return {x, y, z};
}

void ReadBvhChannels(BvhWords& words, BvhClip* clip, BvhClip::Joint* joint) {
  const int count = words.Count(6);
  for (int c = 0; c < count; ++c) {
    const std::string name = words.Next();
    const bool good =
        name.size() == 9 && name[0] >= 'X' && name[0] <= 'Z' && (name.substr(1) == "position" || name.substr(1) == "rotation");
    if (!good) words.Fail("channel '" + name + "'; known are Xposition, …, Zrotation");
    joint->channels.push_back(name);
  }
  clip->num_channels += count;
}

void SkipEndSite(BvhWords& words) {
  words.Line();
  words.Expect("{");
  words.Expect("OFFSET");
  ReadBvhOffset(words);
  words.Expect("}");
}

void ReadBvhHierarchy(BvhWords& words, BvhClip* clip) {
  words.Expect("HIERARCHY");
  std::vector<int> open;
  words.Expect("ROOT");
  do {
    // A joint's head was read; what follows is its name and body up to the first child.
    if (clip->joints.size() >= kMaxBvhJoints) words.Fail("more than " + std::to_string(kMaxBvhJoints) + " joints");
    clip->joints.push_back({words.Line(), open.empty() ? -1 : open.back(), {}, {}});
    open.push_back(static_cast<int>(clip->joints.size()) - 1);
    words.Expect("{");
    for (bool inside = true; inside && !open.empty();) {
      const std::string word = words.Next();
      BvhClip::Joint& joint = clip->joints[open.back()];
      if (word == "OFFSET")
        joint.offset = ReadBvhOffset(words);
      else if (word == "CHANNELS")
        ReadBvhChannels(words, clip, &joint);
      else if (word == "End")
        SkipEndSite(words);
      else if (word == "JOINT")
        inside = false;
      else if (word == "}")
        open.pop_back();
      else
        words.Fail("'" + word + "' in a joint");
    }
  } while (!open.empty());
}

void ReadBvhMotion(BvhWords& words, BvhClip* clip) {
  words.Expect("MOTION");
  words.Expect("Frames:");
  clip->num_frames = words.Count(1 << 26);
  words.Expect("Frame");
  words.Expect("Time:");
  clip->frame_time_s = words.Number();
  if (!(clip->frame_time_s > 0)) words.Fail("the frame time is not positive");
  const size_t count = static_cast<size_t>(clip->num_frames) * static_cast<size_t>(clip->num_channels);
  if (clip->num_frames < 1 || clip->num_channels < 1 || count > kMaxBvhValues) words.Fail("no motion, or too long");
  for (size_t i = 0; i < count; ++i) clip->values.push_back(words.Number());
  if (!words.Done())
    words.Fail("more numbers than " + std::to_string(clip->num_frames) + " frames of " + std::to_string(clip->num_channels) +
               " channels");
}

}  // namespace

BvhClip BvhFromText(const std::string& text, const std::string& path_for_messages) {
  BvhClip clip;
  BvhWords words(text, path_for_messages);
  ReadBvhHierarchy(words, &clip);
  ReadBvhMotion(words, &clip);
  return clip;
}

BvhClip ReadBvh(const std::string& path) { return BvhFromText(ReadFile(path), path); }

BvhPlacement PlaceJoints(const BvhClip& clip, int frame) {
  MVS_CHECK(frame >= -1 && frame < clip.num_frames, "frame " << frame << " of " << clip.num_frames);
  BvhPlacement placement;
  size_t channel = static_cast<size_t>(std::max(frame, 0)) * static_cast<size_t>(clip.num_channels);
  for (const BvhClip::Joint& joint : clip.joints) {
    Eigen::Vector3d offset = joint.offset;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    for (const std::string& name : joint.channels) {
      const double value = frame < 0 ? 0 : clip.values[channel];
      const int axis = name[0] - 'X';
      ++channel;
      if (name[1] == 'r')
        turn = turn * Eigen::AngleAxisd(DegToRad(value), Eigen::Vector3d::Unit(axis)).toRotationMatrix();
      else if (frame >= 0)
        offset[axis] = value;
    }
    const bool root = joint.parent < 0;
    placement.place.push_back(
        root ? offset : Eigen::Vector3d(placement.place[joint.parent] + placement.rotation[joint.parent] * offset));
    placement.rotation.push_back(root ? turn : Eigen::Matrix3d(placement.rotation[joint.parent] * turn));
  }
  return placement;
}

}  // namespace mvstudio::dataset
