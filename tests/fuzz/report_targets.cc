#include <cmath>

#include "core/disk/files.h"
#include "report/page/table_file.h"
#include "report/page/value.h"
#include "report/report.h"
#include "report/study/study_tally.h"
#include "report/viewer/bundle.h"
#include "tests/fuzz/fuzz.h"

/// What `report` and `metrics` read: results of other commands, tables, answers of a user study.
namespace mvstudio::fuzz {

using report::Value;

MVS_FUZZ_TARGET(report_json, bytes) {
  Value value;
  if (!Accepts([&] { value = Value::Parse(std::string(bytes), "a.json"); })) return;
  const std::string text = value.Dump(1);
  Value back;
  Require(Accepts([&] { back = Value::Parse(text, "b.json"); }), "what was written cannot be read");
  Require(back.Dump(1) == text, "the value changes when it is read and written again");
  for (const auto& [key, field] : value.fields()) {
    Require(value[key].Dump() == field.Dump(), "a field is found under the name of another");
  }
}

MVS_FUZZ_TARGET(report_csv, bytes) {
  report::TableFile table;
  if (!Accepts([&] { table = report::ParseTable(std::string(bytes), "a.csv"); })) return;
  Require(!table.columns.empty(), "a table without columns");
  for (const auto& row : table.rows) Require(row.size() == table.columns.size(), "a row of another width than the header");
  for (const std::string& name : table.columns) {
    const int column = table.Column(name);
    Require(column >= 0 && table.columns[static_cast<size_t>(column)] == name, "a column is not found");
    Require(table.Numbers(column).size() == table.rows.size(), "numbers of another count than rows");
  }
}

/// A whole folder: nothing inside it may stop the report, and its own numbers can be read again.
MVS_FUZZ_TARGET(report_run, bytes) {
  static const char* const kNames[] = {
      "calibrate.result.json", "triangulate.result.json", "avatar_eval.result.json", "calibration.json", "points.csv",
      "history.csv",           "provenance.jsonl"};
  const std::string folder = ScratchFolder("run");
  const auto parts = Parts(bytes, std::size(kNames));
  for (size_t i = 0; i < parts.size(); ++i) {
    if (!parts[i].empty()) Scratch(std::string("run/") + kNames[i], parts[i]);
  }
  report::Report page;
  if (!Accepts([&] { page = report::BuildReport(folder); })) return;
  Require(page.html.find("</html>") != std::string::npos, "the page has no end");
  const std::string viewer = "<script>" + std::string(report::ViewerScript()) + "</script>";
  const size_t at = page.html.find(viewer);
  if (at != std::string::npos) page.html.erase(at, viewer.size());
  Require(page.html.find("<script") == std::string::npos, "the page has a script beside its viewer, this program writes none");
  Require(Accepts([&] { Value::Parse(page.json, "report.json"); }), "the numbers of the page cannot be read");
}

MVS_FUZZ_TARGET(study_answers, bytes) {
  const auto parts = Parts(bytes, 2);
  std::vector<report::StudyAnswers> files;
  for (const std::string_view part : parts) {
    if (part.empty()) continue;
    const std::string path = InMemory("answers" + std::to_string(files.size()) + ".json", part);
    if (!Accepts([&] { files.push_back(report::ReadStudyAnswers(path)); })) return;
    Require(!files.back().answers.empty() && !files.back().rater.empty(), "answers of nobody");
  }
  report::StudyTally tally;
  if (!Accepts([&] { tally = report::TallyStudy(files); })) return;
  for (const report::StudyShare& share : tally.raters) {
    Require(share.n > 0 && share.chose_a >= 0 && share.chose_a <= share.n, "a share of more than all");
    Require(share.low <= share.share_a && share.share_a <= share.high, "a share outside its interval");
    Require(share.p_value >= 0 && share.p_value <= 1, "a probability that is none");
  }
}

}  // namespace mvstudio::fuzz
