#include <filesystem>

#include "core/disk/files.h"
#include "report/page/table_file.h"
#include "report/page/value.h"
#include "report/report.h"
#include "report/study/study_tally.h"
#include "tests/support/hostile_readers.h"

namespace mvstudio::testing {
namespace {

/// What is inside a file never stops the report.
void ReadFolder(const std::string& path) {
  const report::Report page = report::BuildReport(std::filesystem::path(path).parent_path().string());
  report::Value::Parse(page.json, "report.json");
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
          {"provenance", "report_run/all.txt", "provenance.jsonl", false, ReadFolder, 6}};
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), HostileReaderName);

}  // namespace
}  // namespace mvstudio::testing
