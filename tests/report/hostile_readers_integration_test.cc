#include <filesystem>

#include "core/disk/files.h"
#include "report/compare/comparison.h"
#include "report/page/table_file.h"
#include "report/page/value.h"
#include "report/report.h"
#include "report/study/study_tally.h"
#include "tests/support/hostile_readers.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::testing {
namespace {

/// What is inside a file never stops the report.
void ReadFolder(const std::string& path) {
  const report::Report page = report::BuildReport(std::filesystem::path(path).parent_path().string());
  report::Value::Parse(page.json, "report.json");
}

/// A sound run to compare with.
std::string SoundRun() {
  static const TempDir folder;
  static const bool written = [] {
    WriteFileAtomic(
        folder / "calibrate.result.json",
        R"({"schema":"mvstudio.result/1","command":"calibrate","status":"ok","exit":0,"argv":["mvstudio","calibrate"],
                        "metrics":{"rms_px":0.3,"cameras":[{"name":"left","rms_px":0.3,"focal_px":500,"focal_sigma_px":0.1}]}})");
    WriteFileAtomic(folder / "avatar_eval.result.json",
                    R"({"schema":"mvstudio.result/1","command":"avatar eval","status":"ok","exit":0,
                        "metrics":{"holdout":{"ssim":0.9},"pictures":[{"path":"a.png"}]}})");
    return true;
  }();
  return written ? folder.path() : "";
}

/// Nor does it stop the comparison with a sound run.
void CompareFolder(const std::string& path) {
  const report::Report page = report::BuildComparison({SoundRun(), std::filesystem::path(path).parent_path().string()});
  report::Value::Parse(page.json, "comparison.json");
}

std::vector<HostileReader> Readers() {
  const auto json = [](const std::string& path) { report::Value::Parse(ReadFile(path), path); };
  const auto csv = [](const std::string& path) { report::ParseTable(ReadFile(path), path); };
  const auto answers = [](const std::string& path) { report::ReadStudyAnswers(path); };
  return {{"json", "report_json/result.json", "a.json", false, json},
          {"csv", "report_csv/history.csv", "a.csv", false, csv},
          {"answers", "study_answers/two.txt", "a.json", true, answers, 0},
          {"calibrate", "report_run/all.txt", "calibrate.result.json", false, ReadFolder, 0},
          {"evaluation", "report_run/all.txt", "avatar_eval.result.json", false, ReadFolder, 2},
          {"calibration", "report_run/all.txt", "calibration.json", false, ReadFolder, 3},
          {"points", "report_run/all.txt", "points.csv", false, ReadFolder, 4},
          {"history", "report_run/all.txt", "history.csv", false, ReadFolder, 5},
          {"provenance", "report_run/all.txt", "provenance.jsonl", false, ReadFolder, 6},
          {"compared_calibrate", "report_run/all.txt", "calibrate.result.json", false, CompareFolder, 0},
          {"compared_evaluation", "report_run/all.txt", "avatar_eval.result.json", false, CompareFolder, 2},
          {"compared_provenance", "report_run/all.txt", "provenance.jsonl", false, CompareFolder, 6}};
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), HostileReaderName);

}  // namespace
}  // namespace mvstudio::testing
