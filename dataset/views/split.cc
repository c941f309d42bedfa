#include "dataset/views/split.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/json/json_file.h"

namespace mvstudio::dataset {
namespace {

using internal::Json;
using internal::JsonView;

// Names come from files: plain ones as they are, others quoted.
std::string Word(const std::string& name) {
  int panel = 0, node = 0;
  return ParsePanopticName(name, &panel, &node) ? name : internal::Quoted(name);
}
std::string Word(int frame) { return std::to_string(frame); }

template <class T>
std::string Listed(const std::vector<T>& items) {
  constexpr size_t kMost = 8;
  std::string text;
  for (size_t i = 0; i < std::min(items.size(), kMost); ++i) text += (i ? ", " : "") + Word(items[i]);
  return items.size() <= kMost ? text : text + " and " + std::to_string(items.size() - kMost) + " more";
}

template <class T>
std::vector<T> Shared(const std::vector<T>& a, const std::vector<T>& b) {
  const std::set<T> left(a.begin(), a.end()), right(b.begin(), b.end());
  std::vector<T> both;
  std::set_intersection(left.begin(), left.end(), right.begin(), right.end(), std::back_inserter(both));
  return both;
}

template <class T>
void NameShared(const std::vector<T>& a, const std::vector<T>& b, const std::string& who, const std::string& what,
                std::vector<std::string>* faults) {
  const std::vector<T> both = Shared(a, b);
  if (!both.empty()) faults->push_back(who + " share " + what + (both.size() > 1 ? "s " : " ") + Listed(both));
}

template <class T>
void NameTwice(const std::vector<T>& items, const std::string& what, std::vector<std::string>* faults) {
  std::set<T> seen;
  std::vector<T> twice;
  for (const T& item : items) {
    if (!seen.insert(item).second) twice.push_back(item);
  }
  if (!twice.empty()) faults->push_back(what + " " + Listed(twice) + (twice.size() > 1 ? " are" : " is") + " there twice");
}

// Of a list that may be left out.
std::vector<JsonView> EntriesOf(const JsonView& json, const char* key) {
  std::vector<JsonView> entries;
  if (!json.Has(key)) return entries;
  const JsonView list = json[key];
  for (size_t i = 0; i < list.ArraySize(); ++i) entries.push_back(list[i]);
  return entries;
}

SplitPart ReadPart(const JsonView& json) {
  SplitPart part;
  const JsonView cameras = json["cameras"], frames = json["frames"];
  for (size_t i = 0; i < cameras.ArraySize(); ++i) part.cameras.push_back(cameras[i].Text());
  for (size_t i = 0; i < frames.ArraySize(); ++i) part.frames.push_back(frames[i].Int());
  std::sort(part.cameras.begin(), part.cameras.end());
  std::sort(part.frames.begin(), part.frames.end());
  return part;
}

// Objects a key a line, arrays on one line: a frame a line would be unreadable.
std::string PartText(const SplitPart& part) {
  return "{\n    \"cameras\": " + Json(part.cameras).dump() + ",\n    \"frames\": " + Json(part.frames).dump() + "\n  }";
}

}  // namespace

std::string_view ToString(PartOfSplit part) {
  constexpr std::string_view kNames[] = {"", "train", "validation", "test"};
  return kNames[static_cast<size_t>(part)];
}

std::vector<std::string> SplitFaults(const Split& split) {
  std::vector<std::string> faults;
  if (split.train.empty()) faults.push_back("train has no cameras or no frames");
  if (split.test.empty()) faults.push_back("test has no cameras or no frames");
  NameShared(split.train.cameras, split.test.cameras, "train and test", "camera", &faults);
  NameShared(split.train.frames, split.test.frames, "train and test", "frame", &faults);
  NameShared(split.validation.cameras, split.test.cameras, "validation and test", "camera", &faults);
  NameShared(split.validation.frames, split.test.frames, "validation and test", "frame", &faults);
  NameShared(split.train.frames, split.validation.frames, "train and validation", "frame", &faults);
  const std::pair<const char*, const SplitPart*> parts[] = {
      {"train", &split.train}, {"validation", &split.validation}, {"test", &split.test}};
  for (const auto& [name, part] : parts) {
    NameTwice(part->cameras, std::string(name) + " camera", &faults);
    NameTwice(part->frames, std::string(name) + " frame", &faults);
  }
  return faults;
}

Split SplitFromJsonText(const std::string& text, const std::string& path) {
  const Json json = internal::ParseJson(text, path);
  const JsonView view(path, json);
  if (!json.is_object() || !view.Has("schema") || view["schema"].Text() != kSplitSchema) {
    view.Fail(std::string("not a split: \"schema\" must be \"") + kSplitSchema + "\"");
  }
  Split split;
  split.dataset = view["dataset"].Text();
  if (view.Has("rule")) split.rule = view["rule"].Text();
  split.train = ReadPart(view["train"]), split.test = ReadPart(view["test"]);
  if (view.Has("validation")) split.validation = ReadPart(view["validation"]);
  if (view.Has("guard_frames")) split.guard_frames = view["guard_frames"].Int();
  for (const JsonView& frame : EntriesOf(view, "unused_frames")) split.unused_frames.push_back(frame.Int());
  for (const JsonView& block : EntriesOf(view, "motion_blocks"))
    split.blocks.push_back({block[size_t{0}].Int(), block[size_t{1}].Int()});
  const std::vector<std::string> faults = SplitFaults(split);
  if (faults.empty()) return split;
  throw FormatError(path, "", Join(faults, "; "));
}

Split ReadSplit(const std::string& path) {
  return SplitFromJsonText(internal::ReadTextFile(path, internal::kMaxJsonBytes), path);
}

std::string SplitToJsonText(const Split& split) {
  Json blocks = Json::array();
  for (const MotionBlock& block : split.blocks) blocks.push_back({block.first, block.last});
  std::string text = "{\n  \"schema\": \"" + std::string(kSplitSchema) + "\",\n  \"dataset\": " + Json(split.dataset).dump() +
                     ",\n  \"rule\": " + Json(split.rule).dump() + ",\n  \"train\": " + PartText(split.train);
  if (!split.validation.empty()) text += ",\n  \"validation\": " + PartText(split.validation);
  return text + ",\n  \"test\": " + PartText(split.test) + ",\n  \"guard_frames\": " + std::to_string(split.guard_frames) +
         ",\n  \"unused_frames\": " + Json(split.unused_frames).dump() + ",\n  \"motion_blocks\": " + blocks.dump() + "\n}\n";
}

void WriteSplit(const Split& split, const std::string& path) {
  const std::vector<std::string> faults = SplitFaults(split);
  MVS_CHECK(faults.empty(), faults.front());
  WriteFileAtomic(path, SplitToJsonText(split));
}

void RequireSplitOf(const Split& split, const PanopticDataset& dataset, const std::string& path) {
  const std::set<int> known(dataset.frames.begin(), dataset.frames.end());
  std::vector<std::string> cameras;
  std::vector<int> frames;
  for (const SplitPart* part : {&split.train, &split.validation, &split.test}) {
    for (const std::string& name : part->cameras) {
      if (dataset.rig.Find(name) < 0) cameras.push_back(name);
    }
    for (const int frame : part->frames) {
      if (!known.count(frame)) frames.push_back(frame);
    }
  }
  std::string missing;
  if (!cameras.empty()) missing = "camera " + Listed(cameras);
  if (!frames.empty()) missing += (missing.empty() ? "" : " and ") + ("frame " + Listed(frames));
  if (missing.empty()) return;
  throw FormatError(path, "",
                    missing + " of the split is not in the dataset " + dataset.root +
                        (split.dataset == dataset.sequence ? "" : "; it was made for '" + split.dataset + "'"));
}

}  // namespace mvstudio::dataset
