#include "stages/study/study.h"

#include <cstdio>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "report/page/format.h"
#include "report/study/study.h"
#include "report/study/study_tally.h"
#include "stages/study/avatar_scores.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxPageBytes = 256u << 20;

/// One side of a study: a folder of images, or a run that `avatar eval` has scored.
struct Side {
  std::string name, folder;
  bool is_run = false;
  std::string Renders() const { return is_run ? folder + "/eval/render" : folder; }
};

Side MakeSide(const std::string& text) {
  const auto [label, folder] = SplitLabel(text);
  RequireFolder(folder);
  Side side{label, folder, fs::is_directory(folder + "/eval/render")};
  if (side.name.empty()) side.name = fs::path(PathOnDisk(folder)).filename().string();
  return side;
}

std::string TruthOf(const StudyArguments& arguments, const Side& a, const Side& b) {
  if (a.is_run && b.is_run) RequireSameProtocol(ReadScoreProtocol(b.folder), ReadScoreProtocol(a.folder));
  if (!arguments.truth.empty()) return arguments.truth;
  for (const Side* side : {&a, &b}) {
    if (side->is_run) return side->folder + "/eval/truth";
  }
  throw UsageError("option 'study' of two folders needs the true images: option 'truth' FOLDER, with the same file names");
}

nlohmann::ordered_json ShareJson(const report::StudyShare& share) {
  return {{"n", share.n},
          {"first", share.chose_a},
          {"share", FiniteOrNull(share.share_a)},
          {"ci95", {FiniteOrNull(share.low), FiniteOrNull(share.high)}},
          {"p_value", FiniteOrNull(share.p_value)},
          {"left", share.chose_left}};
}

std::string ShareLine(const std::string& name, const report::StudyShare& share) {
  return Format("  %-24s %4lld of %4lld  %5.1f %% [%5.1f, %5.1f]  p %.3g  left %lld\n", name.c_str(),
                static_cast<long long>(share.chose_a), static_cast<long long>(share.n), 100 * share.share_a, 100 * share.low,
                100 * share.high, share.p_value, static_cast<long long>(share.chose_left));
}

}  // namespace

CommandResult RunStudy(const StudyArguments& arguments, const std::string& out, uint64_t seed) {
  if (out.empty()) throw UsageError("option 'study' needs option 'out' FILE.html");
  if (arguments.images < 1) throw UsageError("option 'study-pictures' must be at least 1");
  if (arguments.sides.size() != 2) throw UsageError("option 'study' needs two sides");
  const Side a = MakeSide(arguments.sides.at(0)), b = MakeSide(arguments.sides.at(1));
  const std::string truth = TruthOf(arguments, a, b);
  std::vector<std::string> unmatched;
  report::StudySpec spec;
  const auto images = report::ReadStudyImages(truth, a.Renders(), b.Renders(), &unmatched, arguments.follow_links);
  spec.images = report::ThinStudy(images, arguments.images);
  spec.methods = {a.name, b.name};
  spec.title = arguments.title;
  spec.seed = seed;
  const report::Study study = report::MakeStudy(spec);
  if (study.html.size() > kMaxPageBytes)
    throw UsageError("the page would have " + std::to_string(study.html.size() >> 20) +
                     " MB; ask less with option 'study-pictures'");
  const std::string key = fs::path(out).replace_extension(".key.json").string();
  const OutputFiles place({out, key}, {});
  FilesTogether together;
  WriteFileAtomic(key, study.json);
  WriteFileAtomic(out, study.html);
  together.Commit();
  CommandResult result;
  result.metrics = {{"study", study.sha256},
                    {"methods", {a.name, b.name}},
                    {"questions", spec.images.size()},
                    {"html_bytes", study.html.size()}};
  result.outputs = {{out, "study"}, {key, "study-key"}};
  result.inputs = {a.Renders(), b.Renders(), truth};
  result.text = std::to_string(spec.images.size()) + " questions, " + a.name + " against " + b.name +
                ". Give raters the page alone; the key tells the sides.";
  if (!unmatched.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back(
        {"STUDY-UNMATCHED",
         std::to_string(unmatched.size()) + " images are not in all three folders; the first: " + unmatched[0],
         "all three folders must hold the same file names"});
  }
  return result;
}

CommandResult RunStudyTally(const StudyArguments& arguments) {
  std::vector<report::StudyAnswers> files;
  for (const std::string& path : arguments.tally) files.push_back(report::ReadStudyAnswers(path));
  const report::StudyTally tally = report::TallyStudy(files);
  CommandResult result;
  result.metrics["study"] = tally.study;
  result.metrics["methods"] = {tally.methods[0], tally.methods[1]};
  result.metrics["pooled"] = ShareJson(tally.pooled);
  result.metrics["raters"] = nlohmann::ordered_json::array();
  result.text = "'" + tally.methods[0] + "' preferred to '" + tally.methods[1] + "': share [95 %], sign test\n";
  for (const report::StudyShare& share : tally.raters) {
    nlohmann::ordered_json row = {{"rater", share.rater}};
    row.update(ShareJson(share));
    result.metrics["raters"].push_back(row);
    result.text += ShareLine(share.rater, share);
  }
  result.text += ShareLine("all answers", tally.pooled);
  result.inputs = arguments.tally;
  return result;
}

}  // namespace mvstudio::stages
