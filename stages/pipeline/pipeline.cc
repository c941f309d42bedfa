#include "stages/pipeline/pipeline.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using dataset::Session;
using dataset::SessionTake;
using dataset::TakeKind;

/// The command that wrote the first file below a folder; empty: mvstudio did not. Nothing: there is no file.
std::optional<std::string> WriterOfFolder(const std::string& folder) {
  std::error_code none;
  for (fs::recursive_directory_iterator at(folder, none), end; !none && at != end; at.increment(none)) {
    if (at->is_regular_file(none) && at->path().filename().string()[0] != '.') return WriterOf(at->path().string());
  }
  return std::nullopt;
}

class PipelineBuilder {
 public:
  PipelineBuilder(const Session& session, const PipelineOptions& options) : session_(session), o_(options) {}

  std::vector<PipelineStage> Build() {
    Calibrate();
    for (const SessionTake& take : session_.takes) {
      const bool chosen = o_.take.empty() ? take.kind == TakeKind::kPeople : take.name == o_.take;
      if (chosen) Take(take);
    }
    PipelineStage& report = Add(StageKind::kReport, "", {"report", o_.session}, {}, o_.session + "/report.html");
    for (const PipelineStage& stage : stages_) {
      if (stage.kind != StageKind::kReport && stage.left_out.empty()) report.inputs.push_back(stage.output);
    }
    CheckSettings();
    return std::move(stages_);
  }

 private:
  /// In the session's folder, as the caller names it.
  std::string Place(const std::string& kind, const SessionTake& take, const std::string& end = "") const {
    return o_.session + "/" + kind + "/" + dataset::Slug(take.name) + end;
  }

  using Settings = std::vector<LineOption>;

  PipelineStage& Add(StageKind kind, const std::string& take, std::vector<std::string> command, Settings options,
                     std::string output) {
    PipelineStage stage{kind, o_.session, take, std::move(command), std::move(options), {}, std::move(output), "", false};
    const auto settings = session_.settings.find(std::string(ToString(kind)));
    if (settings != session_.settings.end())
      for (const dataset::SessionSetting& setting : settings->second) stage.options.push_back({setting.key, setting.values});
    stages_.push_back(std::move(stage));
    return stages_.back();
  }

  Settings OfSession(Settings options) const {
    if (o_.allow_outside) options.push_back({"allow-outside", {}});
    return options;
  }

  PipelineStage& OfTake(StageKind kind, const SessionTake& take, std::vector<std::string> command, std::string output) {
    Settings options = OfSession({{"session", {o_.session}}, {"take", {take.name}}});
    return Add(kind, take.name, std::move(command), std::move(options), std::move(output));
  }

  void AddFootage(const SessionTake& take, bool plates, std::vector<std::string>* inputs) const {
    for (const dataset::SessionFootage& footage : take.footage) {
      inputs->push_back(dataset::ResolveInSession(session_, footage.path, o_.allow_outside));
      if (plates && !footage.plate.empty())
        inputs->push_back(dataset::ResolveInSession(session_, footage.plate, o_.allow_outside));
    }
  }

  void Calibrate() {
    const auto board = std::find_if(session_.takes.begin(), session_.takes.end(),
                                    [](const SessionTake& take) { return take.kind == TakeKind::kBoard; });
    const bool films = board != session_.takes.end() && !session_.board.empty();
    PipelineStage& stage =
        Add(StageKind::kCalibrate, "", {"calibrate"}, OfSession({{"session", {o_.session}}}), o_.session + "/calib");
    if (!session_.calibration.empty()) {
      stage.left_out = "the session names its calibration";
    } else if (!films) {
      stage.left_out = "no take with a board";
    }
    calibration_ = o_.session + "/calib/calibration.json";
    if (stage.left_out.empty()) return AddFootage(*board, false, &stage.inputs);
    calibration_ = dataset::CalibrationOf(session_, o_.allow_outside);
    if (calibration_.empty()) {
      throw UsageError(o_.session +
                       ": has neither a calibration nor a take of kind \"board\" with board = \"…\" in mvstudio.toml; "
                       "film a board, or name the calibration there");
    }
  }

  void Take(const SessionTake& take) {
    Timing(take);
    Joints(take);
    const std::string dataset = Place("dataset", take);
    PipelineStage& mask = OfTake(StageKind::kMask, take, {"mask"}, Place("masks", take));
    mask.inputs = {calibration_, Place("pose3d", take, "/points.csv")};
    AddFootage(take, true, &mask.inputs);
    PipelineStage& build = OfTake(StageKind::kDataset, take, {"dataset", "build"}, dataset);
    build.inputs = {calibration_, Place("pose3d", take, "/points.csv"), Place("masks", take)};
    AddFootage(take, true, &build.inputs);
    Learning(take, dataset);
  }

  /// When each camera's frames were taken.
  void Timing(const SessionTake& take) {
    PipelineStage& timeline = Add(StageKind::kTimeline, take.name, {"session", "timeline", o_.session},
                                  OfSession({{"take", {take.name}}}), Place("sync", take, ".timeline.json"));
    if (take.timestamps.empty()) {
      timeline.left_out = "the take has no table of time stamps";
    } else {
      timeline.inputs = {dataset::ResolveInSession(session_, take.timestamps, o_.allow_outside)};
      AddFootage(take, false, &timeline.inputs);
    }
  }

  void Joints(const SessionTake& take) {
    const std::string joints = Place("pose2d", take), points = Place("pose3d", take);
    PipelineStage& pose2d = OfTake(StageKind::kPose2d, take, {"pose2d"}, joints);
    AddFootage(take, false, &pose2d.inputs);
    const std::optional<std::string> writer = WriterOfFolder(joints);
    if (writer && *writer != "pose2d") pose2d.left_out = "2D joints of another program are there";
    PipelineStage& sync = OfTake(StageKind::kSync, take, {"sync"}, Place("sync", take, "/sync.json"));
    sync.inputs = {calibration_, joints};
    sync.may_fail = true;  // people who stand still say nothing of time; then all cameras count frames alike
    if (!take.timestamps.empty()) sync.left_out = "time stamps say when each frame was taken";
    if (!take.sync.empty()) sync.left_out = "the session names the offsets";
    PipelineStage& triangulate = OfTake(StageKind::kTriangulate, take, {"triangulate"}, points);
    triangulate.inputs = {calibration_, joints, Place("sync", take, "/sync.json"), Place("sync", take, ".timeline.json")};
  }

  void Learning(const SessionTake& take, const std::string& dataset) {
    const std::string checked = Place("verify", take), pack = Place("pack", take), out = Place("export", take);
    Add(StageKind::kVerify, take.name, {"dataset", "verify", dataset}, {{"keep", {checked}}}, checked).inputs = {dataset};
    OnDemand(Add(StageKind::kPack, take.name, {"dataset", "pack", dataset}, {{"out", {pack}}}, pack), dataset);
    OnDemand(Add(StageKind::kExport, take.name, {"dataset", "export", dataset}, {{"out", {out}}}, out), dataset);
    const std::string split = Place("splits", take, ".json"), avatar = Place("avatar", take);
    PipelineStage& parts = Add(StageKind::kSplit, take.name, {"dataset", "split", dataset}, {{"out", {split}}}, split);
    parts.inputs = {dataset};
    if (session_.settings.count("split") == 0) parts.options.push_back({"every-camera", {"3"}});
    Add(StageKind::kAvatar, take.name, {"avatar", "train", dataset}, {{"split", {split}}, {"out", {avatar}}},
        avatar + "/avatar_train.result.json")  // there when the training has ended
        .inputs = {dataset, split};
    Add(StageKind::kEval, take.name, {"avatar", "eval", avatar}, {}, avatar + "/eval").inputs = {
        avatar + "/checkpoint.safetensors", avatar + "/config.json", avatar + "/body.npz", avatar + "/textures.png"};
  }

  void OnDemand(PipelineStage& stage, const std::string& dataset) const {
    const std::string word(ToString(stage.kind));
    const bool named = std::find(o_.only.begin(), o_.only.end(), word) != o_.only.end();
    stage.inputs = {dataset};
    if (!named && session_.settings.count(word) == 0)
      stage.left_out = "not asked for: option 'only' " + word + ", or [run." + word + "] in mvstudio.toml";
  }

  void CheckSettings() const {
    for (const auto& [word, settings] : session_.settings) {
      if (!ChoiceOf(kStageWords, word))
        throw FormatError(o_.session + "/mvstudio.toml", "run." + word, "is no stage of `mvstudio run`");
    }
  }

  const Session& session_;
  const PipelineOptions& o_;
  std::string calibration_;
  std::vector<PipelineStage> stages_;
};

StageKind KindOf(const std::string& word) {
  StageKind kind{};
  FromString(word, &kind);
  return kind;
}

}  // namespace

void FromString(const std::string& text, StageKind* kind) {
  std::vector<std::string> words;
  for (const auto& [known, word] : kStageWords) words.emplace_back(word);
  *kind = KnownChoice(kStageWords, text, "stage " + text + ": expected " + Join(words, ", "));
}

std::string PipelineStage::name() const {
  return std::string(ToString(kind)) + (take.empty() ? "" : " " + take) + (part.empty() ? "" : " " + part);
}

std::vector<PipelineStage> PipelineOf(const Session& session, const PipelineOptions& options) {
  if (!options.take.empty()) dataset::TakeOf(session, options.take);
  return PipelineBuilder(session, options).Build();
}

bool Reads(const PipelineStage& later, const PipelineStage& earlier) {
  if (!earlier.take.empty() && !later.take.empty() && earlier.take != later.take) return false;
  // Training ends with its result; what others read lies beside it.
  const bool beside = earlier.kind == StageKind::kAvatar;
  const std::string folder = (beside ? fs::path(earlier.output).parent_path().string() : earlier.output) + "/";
  return std::any_of(later.inputs.begin(), later.inputs.end(),
                     [&](const std::string& input) { return input == earlier.output || input.rfind(folder, 0) == 0; });
}

bool IsAskedFor(const PipelineStage& stage, const PipelineOptions& options) {
  if (options.to < options.from) {
    throw UsageError("option 'to' " + std::string(ToString(options.to)) + " comes before option 'from' " +
                     std::string(ToString(options.from)));
  }
  if (stage.kind < options.from || stage.kind > options.to) return false;
  return options.only.empty() || std::any_of(options.only.begin(), options.only.end(),
                                             [&](const std::string& word) { return KindOf(word) == stage.kind; });
}

}  // namespace mvstudio::stages
