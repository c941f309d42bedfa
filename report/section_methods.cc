#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "report/page/format.h"
#include "report/sections.h"

/// Several scored runs beside each other: one table, and their images of the same held-out frames.
namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFrames = 6;

/// A scored run and what it is called here.
struct Method {
  const Stage* stage;
  std::string name;
};

std::string MethodOf(const Stage& eval) {
  const std::string method = eval.metrics().Path("training")["options"]["model.method"].Text(eval.metrics()["method"].Text());
  const bool trained = method != "tna" || eval.metrics()["checkpoint_step"].Number() != 0;
  return trained ? method : "textured body";
}

/// Their methods, and their folders where two have the same one.
std::vector<Method> NamedRuns(const std::vector<const Stage*>& stages) {
  std::map<std::string, int> count;
  for (const Stage* stage : stages) ++count[MethodOf(*stage)];
  std::vector<Method> methods;
  for (const Stage* stage : stages) {
    const std::string method = MethodOf(*stage), folder = stage->folder.empty() ? "this folder" : stage->folder;
    const bool alone = !method.empty() && count[method] == 1;
    methods.push_back({stage, alone ? method : method.empty() ? folder : method + " (" + folder + ")"});
  }
  return methods;
}

/// Runs by the protocol that scored them, in the order of the page; runs without one are alone.
std::vector<std::vector<const Stage*>> ByProtocol(const RunData& data) {
  std::vector<std::vector<const Stage*>> groups;
  for (const Stage* stage : data.All("avatar eval")) {
    const std::string protocol = stage->metrics()["protocol_sha256"].Text();
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
      return !protocol.empty() && group.front()->metrics()["protocol_sha256"].Text() == protocol;
    });
    if (same == groups.end()) {
      groups.push_back({stage});
    } else {
      same->push_back(stage);
    }
  }
  return groups;
}

struct Score {
  const char *key, *title, *unit;
  bool larger_is_better;
  int decimals;
};
constexpr Score kScores[] = {{"ssim", "SSIM", "", true, 4},         {"psnr_db", "PSNR", "dB", true, 2},
                             {"mask_iou", "mask IoU", "", true, 4}, {"fd.value", "Fr\u00e9chet distance", "", false, 3},
                             {"lpips", "LPIPS", "", false, 4},      {"flicker", "flicker", "", false, 4}};

/// A method or a baseline of the first of them.
struct ScoredRow {
  std::string name;
  const Value* scores;
  double seconds;
};

std::vector<ScoredRow> RowsOf(const std::vector<Method>& methods) {
  std::vector<ScoredRow> rows;
  for (const Method& method : methods) {
    const Value& metrics = method.stage->metrics();
    rows.push_back({method.name, &metrics["holdout"], metrics["seconds_per_frame"].Number()});
  }
  for (const auto& [key, scores] : methods.front().stage->metrics()["baselines"].fields()) {
    if (scores.IsObject())
      rows.push_back({"baseline: " + LabelOfKey(key).label, &scores, std::numeric_limits<double>::quiet_NaN()});
  }
  return rows;
}

/// NaN where no row has the score.
double BestOf(const std::vector<ScoredRow>& rows, const Score& score) {
  double best = std::numeric_limits<double>::quiet_NaN();
  for (const ScoredRow& row : rows) {
    const double value = row.scores->Path(score.key).Number();
    if (!std::isfinite(value)) continue;
    if (!std::isfinite(best) || (score.larger_is_better ? value > best : value < best)) best = value;
  }
  return best;
}

std::string MethodTable(const std::vector<Method>& methods) {
  const std::vector<ScoredRow> rows = RowsOf(methods);
  std::vector<std::pair<const Score*, double>> shown;  // with the best of all rows
  for (const Score& score : kScores) {
    const double best = BestOf(rows, score);
    if (std::isfinite(best)) shown.emplace_back(&score, best);
  }
  Table table("On the same held-out images");
  table.AddColumn("method", "", false);
  table.AddColumn("images");
  for (const auto& [score, best] : shown) table.AddColumn(score->title, score->unit);
  table.AddColumn("seconds an image");
  for (const ScoredRow& row : rows) {
    std::vector<Table::Cell> cells = {Table::Cell(row.name), Table::Cell(FormatNumber((*row.scores)["n"].Number()))};
    for (const auto& [score, best] : shown) {
      const double value = row.scores->Path(score->key).Number();
      cells.emplace_back(FormatFixed(value, score->decimals), value == best);
    }
    cells.emplace_back(FormatNumber(row.seconds, 3));
    table.AddRow(std::move(cells));
  }
  return table.Html() + ParagraphHtml("Bold: the best of methods and baselines.", "muted");
}

/// File names of the images that every run kept, with their captions: the first of each camera, then the others.
std::vector<std::pair<std::string, std::string>> SharedImages(const SectionContext& context,
                                                              const std::vector<Method>& methods) {
  std::vector<std::pair<std::string, std::string>> first, others;
  std::set<std::string> cameras;
  for (const Value& image : methods.front().stage->metrics()["pictures"].items()) {
    const std::string name = fs::path(image["path"].Text()).filename().string(), camera = image["camera"].Text();
    const bool all = std::all_of(methods.begin(), methods.end(), [&](const Method& method) {
      return !ImageOfEval(context, *method.stage, "render", name).IsNull();
    });
    if (name.empty() || !all) continue;
    const std::string caption = "camera " + camera + ", frame " + FormatNumber(image["frame"].Number(), 9);
    (cameras.insert(camera).second ? first : others).emplace_back(name, caption);
  }
  first.insert(first.end(), others.begin(), others.end());
  if (first.size() > kMaxFrames) first.resize(kMaxFrames);
  return first;
}

std::string Strips(SectionContext* context, const std::vector<Method>& methods) {
  std::string html;
  for (const auto& [name, caption] : SharedImages(*context, methods)) {
    std::vector<std::string> figures;
    const Stage& first = *methods.front().stage;
    const Value truth = ImageOfEval(*context, first, "truth", name);
    if (!truth.IsNull()) figures.push_back(EmbedOutput(context, first, truth, "truth"));
    for (const Method& method : methods) {
      const Value& holdout = method.stage->metrics();
      std::string score;
      for (const Value& image : holdout["pictures"].items()) {
        if (fs::path(image["path"].Text()).filename() == name && image["ssim"].IsNumber())
          score = ", SSIM " + FormatFixed(image["ssim"].Number(), 3);
      }
      const Value image = ImageOfEval(*context, *method.stage, "render", name);
      figures.push_back(EmbedOutput(context, *method.stage, image, method.name + score));
    }
    html += ParagraphHtml(caption, "muted") + GridHtml(figures, "grid methods");
  }
  return html;
}

}  // namespace

Value ImageOfEval(const SectionContext& context, const Stage& stage, const char* kind, const std::string& name) {
  const fs::path path = fs::path(stage.folder) / "eval" / kind / name;
  const std::string file = FileOfRun(stage, path.string(), context.options.follow_links);
  return file.empty() ? Value() : Value::Object().Set("path", fs::absolute(file).string());
}

std::string MethodsSideBySide(SectionContext* context) {
  std::string html;
  int alone = 0;
  for (const auto& group : ByProtocol(context->data)) {
    if (group.size() < 2) {
      ++alone;
      continue;
    }
    const std::vector<Method> methods = NamedRuns(group);
    html += "<h3>Methods side by side</h3>\n" + MethodTable(methods) + Strips(context, methods);
    Value names = Value::Array();
    for (const Method& method : methods) {
      names.Append(Value::Object()
                       .Set("name", method.name)
                       .Set("file", method.stage->file)
                       .Set("holdout", method.stage->metrics()["holdout"]));
    }
    Value list = context->json["methods"];
    context->json.Set("methods", list.Append(names));
  }
  const bool compared = !html.empty();
  if ((compared && alone > 0) || alone > 1) {
    html += ParagraphHtml(std::to_string(alone) + (alone == 1 ? " run is" : " runs are") +
                              " not in a table: scored by another protocol, scores of "
                              "different protocols cannot be compared. Run avatar eval with the same options on all.",
                          "muted");
  }
  return html;
}

}  // namespace mvstudio::report
