#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/fields.h"

/// From the footage of a session to a scored avatar and its report: what a caller gives.
namespace mvstudio::stages {

/// In their order.
enum class StageKind {
  kCalibrate,
  kTimeline,
  kPose2d,
  kSync,
  kTriangulate,
  kMask,
  kDataset,
  kVerify,
  kPack,
  kExport,
  kSplit,
  kAvatar,
  kEval,
  kReport
};

inline constexpr ChoiceWords<StageKind, 14> kStageWords = {{{StageKind::kCalibrate, "calibrate"},
                                                            {StageKind::kTimeline, "timeline"},
                                                            {StageKind::kPose2d, "pose2d"},
                                                            {StageKind::kSync, "sync"},
                                                            {StageKind::kTriangulate, "triangulate"},
                                                            {StageKind::kMask, "mask"},
                                                            {StageKind::kDataset, "dataset"},
                                                            {StageKind::kVerify, "verify"},
                                                            {StageKind::kPack, "pack"},
                                                            {StageKind::kExport, "export"},
                                                            {StageKind::kSplit, "split"},
                                                            {StageKind::kAvatar, "avatar"},
                                                            {StageKind::kEval, "eval"},
                                                            {StageKind::kReport, "report"}}};
inline std::string_view ToString(StageKind kind) { return WordOf(kStageWords, kind); }
/// Throws UsageError that lists the words.
void FromString(const std::string& text, StageKind* kind);

struct PipelineOptions {
  std::string session;
  std::string take;  ///< empty: all takes with people
  StageKind from = StageKind::kCalibrate, to = StageKind::kReport;
  std::vector<std::string> only;    ///< words of stages; empty: all between `from` and `to`
  std::vector<std::string> accept;  ///< codes of errors that do not stop it
  bool dry_run = false;
  bool again = false;  ///< stages that are up to date are done again
  bool allow_outside = false;
  std::string budget;  ///< time for all of it, as ParseSeconds reads it; empty: not asked for
};

/// Which stages of which takes.
template <class Visitor>
void VisitStageChoice(Visitor&& visit, PipelineOptions& o) {
  visit("take", o.take, "take of the session; all with people unless given");
  StartGroup(visit, "Stages");
  visit("from", o.from,
        "first stage: calibrate, timeline, pose2d, sync, triangulate, mask, dataset, verify, pack, export, split, "
        "avatar, eval, report");
  visit("to", o.to, "last stage");
  VisitStyled(visit, OptionStyle::kList, "only", o.only, "these stages alone, with commas");
  VisitStyled(visit, OptionStyle::kList, "accept", o.accept, "codes of errors, with commas, that do not stop it");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.allow_outside,
              "allow the session to name files outside its folder");
}

template <class Visitor>
void VisitFields(Visitor&& visit, PipelineOptions& o) {
  VisitStageChoice(visit, o);
  visit("dry-run", o.dry_run, "print what would be done and why, and do nothing");
  visit("again", o.again, "do the chosen stages again, also those that are up to date");
  visit("budget", o.budget,
        "time that all stages may take together, e.g. 30min: it is split among calibrate, pose2d and triangulate, as option "
        "'budget' of each");
}

}  // namespace mvstudio::stages
