#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/sections.h"
#include "report/svg/svg.h"

namespace mvstudio::report {
namespace {

constexpr size_t kMaxCurvePoints = 400;
const ImageRole kTextures{"textures", "", {}, false, "the surface of each part of the body, as the network learned it"};

/// Rows of one phase; long ones are averaged in equal bins.
LineSeries Curve(const std::string& name, const std::vector<double>& x, const std::vector<double>& y) {
  LineSeries series{name, {}, {}, false};
  const size_t bin = (x.size() + kMaxCurvePoints - 1) / kMaxCurvePoints;
  for (size_t begin = 0; begin < x.size(); begin += std::max<size_t>(bin, 1)) {
    const size_t end = std::min(x.size(), begin + bin);
    double sum_x = 0, sum_y = 0;
    for (size_t i = begin; i < end; ++i) sum_x += x[i], sum_y += y[i];
    series.x.push_back(sum_x / static_cast<double>(end - begin));
    series.y.push_back(sum_y / static_cast<double>(end - begin));
  }
  return series;
}

std::vector<std::string> PhasesOf(const TableFile& table, int column) {
  std::vector<std::string> phases;
  for (const auto& row : table.rows) {
    const std::string phase = column < 0 ? "" : row[column];
    if (std::find(phases.begin(), phases.end(), phase) == phases.end()) phases.push_back(phase);
  }
  return phases;
}

bool IsScore(const std::string& column) {
  return column.find("ssim_") != std::string::npos || column.find("psnr") != std::string::npos ||
         column.find("iou") != std::string::npos;
}

std::string CurveFigure(const TableFile& table, int step, int phase, int column, double width) {
  const KeyLabel label = LabelOfKey(table.columns[column]);
  LineChartSpec spec;
  spec.title = label.label == "total"           ? "loss, all terms"
               : IsScore(table.columns[column]) ? label.label
                                                : "loss: " + label.label;
  spec.x.label = "step";
  spec.y.label = label.label + (label.unit.empty() ? "" : " (" + label.unit + ")");
  spec.width = width;
  spec.height = width > 500 ? 300 : 210;
  double low = std::numeric_limits<double>::infinity(), high = 0;
  int colour = -1;
  for (const std::string& name : PhasesOf(table, phase)) {
    ++colour;  // of the phase, the same in every figure
    std::vector<double> x, y;
    for (size_t row = 0; row < table.rows.size(); ++row) {
      const double value = table.Number(row, column);
      if ((phase >= 0 && table.rows[row][phase] != name) || !std::isfinite(value)) continue;
      x.push_back(table.Number(row, step));
      y.push_back(value);
    }
    if (std::all_of(y.begin(), y.end(), [](double v) { return v == 0; })) continue;
    low = std::min(low, *std::min_element(y.begin(), y.end()));
    high = std::max(high, *std::max_element(y.begin(), y.end()));
    spec.series.push_back(Curve(name.empty() ? label.label : name, x, y));
    spec.series.back().colour = colour;
  }
  if (spec.series.empty()) return {};
  spec.y.log = low > 0 && high > 8 * low && !IsScore(table.columns[column]);
  return FigureHtml(LineChart(spec), "");
}

std::string Curves(SectionContext* context, const CsvFile& history) {
  const TableFile& table = history.table;
  const int step = table.Column("step"), phase = table.Column("phase");
  if (step < 0 || table.rows.empty()) return {};
  const bool several = context->data.histories.size() > 1;
  std::string html =
      "<h3>Training" + (several ? " <span class=\"unit\">" + EscapeHtml(history.file) + "</span>" : std::string()) + "</h3>\n";
  std::string first;
  std::vector<std::string> small;
  for (int column = 0; column < static_cast<int>(table.columns.size()); ++column) {
    const std::string& name = table.columns[column];
    if (column == step || column == phase || name == "wall_s" || name == "lr" || small.size() >= 12) continue;
    const bool main = first.empty() && (name == "total" || name == "loss");
    const std::string figure = CurveFigure(table, step, phase, column, 360);
    if (figure.empty()) continue;
    if (main) {
      first = figure;
    } else {
      small.push_back(figure);
    }
  }
  if (!first.empty()) small.insert(small.begin(), first);
  const auto end = small.begin() + static_cast<std::ptrdiff_t>(std::min<size_t>(small.size(), 4));
  html += GridHtml({small.begin(), end}, "grid small");
  Value last = Value::Object();
  for (size_t column = 0; column < table.columns.size(); ++column) {
    const double number = table.Number(table.rows.size() - 1, static_cast<int>(column));
    last.Set(table.columns[column], std::isfinite(number) ? Value(number) : Value(table.rows.back()[column]));
  }
  const double wall = last["wall_s"].Number();
  html +=
      ParagraphHtml(FormatCount(static_cast<double>(table.rows.size())) + " rows, last at step " +
                        FormatNumber(last["step"].Number()) + (std::isfinite(wall) ? " after " + FormatDuration(wall) : "") +
                        ". Mean loss terms of the steps since the row before, unweighted.",
                    "muted");
  if (end != small.end()) html += DetailsHtml("More curves", GridHtml({end, small.end()}, "grid small"));
  Value list = context->json["training"];
  context->json.Set(
      "training",
      list.Append(
          Value::Object().Set("file", history.file).Set("rows", static_cast<int64_t>(table.rows.size())).Set("last", last)));
  return html;
}

struct ScoreRow {
  std::string name;
  const Value* scores;
  bool own;
};

bool HasScores(const Value& value) {
  return value["ssim"].IsNumber() || value["psnr_db"].IsNumber() || value["mask_iou"].IsNumber();
}

std::vector<ScoreRow> ScoreRows(const Value& metrics) {
  std::vector<ScoreRow> rows;
  for (const auto& [key, value] : metrics.fields()) {
    if (HasScores(value))
      rows.push_back({key == "holdout" ? "this avatar, " + value["kind"].Text("held out") : LabelOfKey(key).label, &value,
                      key == "holdout"});
  }
  for (const auto& [key, value] : metrics["other_splits"].fields()) {
    if (value.IsObject()) rows.push_back({"this avatar, " + key, &value, false});
  }
  for (const auto& [key, value] : metrics["baselines"].fields()) {
    if (value.IsObject()) rows.push_back({"baseline: " + LabelOfKey(key).label, &value, false});
  }
  return rows;
}

std::string ScoresTable(const Value& metrics) {
  const std::vector<ScoreRow> rows = ScoreRows(metrics);
  if (rows.empty()) return {};
  Table table("Scores beside the baselines, on the same images");
  table.AddColumn("", "", false);
  table.AddColumn("images");
  table.AddColumn("SSIM");
  table.AddColumn("PSNR", "dB");
  table.AddColumn("mask IoU");
  table.AddColumn("Fr\u00e9chet distance");
  table.AddColumn("its floor");
  table.AddColumn("features", "", false);
  table.AddColumn("n");
  table.AddColumn("d");
  const auto best = [&](const std::string& key, bool larger) {
    double value = std::numeric_limits<double>::quiet_NaN();
    for (const ScoreRow& row : rows) {
      if (!row.own && row.name.rfind("baseline", 0) != 0) continue;
      const double candidate = row.scores->Path(key).Number();
      if (std::isfinite(candidate) && (!std::isfinite(value) || (larger ? candidate > value : candidate < value)))
        value = candidate;
    }
    return value;
  };
  const double ssim = best("ssim", true), psnr = best("psnr_db", true), iou = best("mask_iou", true),
               fd = best("fd.value", false);
  for (const ScoreRow& row : rows) {
    const Value& s = *row.scores;
    const auto cell = [](double value, double top, int decimals) {
      return Table::Cell(FormatFixed(value, decimals), value == top);
    };
    table.AddRow({row.name,
                  FormatNumber(s["n"].Number()),
                  cell(s["ssim"].Number(), ssim, 4),
                  cell(s["psnr_db"].Number(), psnr, 2),
                  cell(s["mask_iou"].Number(), iou, 4),
                  {FormatNumber(s.Path("fd.value").Number()), s.Path("fd.value").Number() == fd},
                  FormatNumber(s.Path("fd.floor").Number()),
                  s.Path("fd.features").Text(kNoNumber),
                  FormatNumber(s.Path("fd.n").Number()),
                  FormatNumber(s.Path("fd.d").Number())},
                 row.own);
  }
  return table.Html() + ParagraphHtml(
                            "Bold: the best of avatar and baselines. SSIM, PSNR and IoU: more is better; Fr\u00e9chet "
                            "distance: less is better; "
                            "compare it only at equal features, n and d, and against its floor.",
                            "muted");
}

std::string CameraBars(const Value& per_camera) {
  if (per_camera.items().size() < 2) return {};  // the line above says it
  std::vector<std::string> figures;
  const std::pair<const char*, const char*> kScores[] = {
      {"ssim", "SSIM (no unit)"}, {"psnr_db", "PSNR (dB)"}, {"mask_iou", "mask IoU (no unit)"}};
  for (const auto& [key, label] : kScores) {
    BarChartSpec spec;
    spec.title = std::string(label).substr(0, std::string(label).find(" (")) + " of each camera";
    spec.value.label = label;
    spec.width = 360;
    BarSeries own{"avatar", {}, {}};
    for (const Value& camera : per_camera.items()) {
      spec.labels.push_back(camera["camera"].Text(camera["name"].Text("?")));
      own.values.push_back(camera[key].Number());
    }
    spec.series = {own};
    if (FiniteValues(own.values).empty()) continue;
    for (const auto& [name, ignored] : per_camera.At(0)["baselines"].fields()) {
      BarSeries baseline{LabelOfKey(name).label, {}, {}};
      for (const Value& camera : per_camera.items()) baseline.values.push_back(camera["baselines"][name][key].Number());
      spec.series.push_back(baseline);
    }
    figures.push_back(FigureHtml(BarChart(spec), ""));
  }
  return figures.empty() ? "" : GridHtml(figures, "grid small");
}

/// 95 % intervals and what the numbers mean, where the result says so.
std::string Intervals(const Value& metrics) {
  std::string text;
  const Value &ssim = metrics.Path("holdout.ssim_ci95"), &psnr = metrics.Path("holdout.psnr_db_ci95");
  if (ssim.At(0).IsNumber())
    text += "95 % interval of the held-out SSIM " + FormatFixed(ssim.At(0).Number(), 4) + " to " +
            FormatFixed(ssim.At(1).Number(), 4);
  if (psnr.At(0).IsNumber()) {
    text += (text.empty() ? "95 % interval of the held-out PSNR " : ", of the PSNR ") + FormatFixed(psnr.At(0).Number(), 2) +
            " to " + FormatFixed(psnr.At(1).Number(), 2) + "\u00a0dB";
  }
  if (!text.empty()) text += ". ";
  text += metrics["convention"].Text();
  return text.empty() ? "" : ParagraphHtml(text, "muted");
}

/// "Held-out images: SSIM 0.913, PSNR 24.5 dB, mask IoU 0.95."
std::string ScoreLine(const Value& metrics) {
  const Value& own = metrics["holdout"];
  if (!HasScores(own)) return {};
  std::string text = "Held-out images: SSIM " + FormatFixed(own["ssim"].Number(), 3);
  text +=
      ", PSNR " + FormatFixed(own["psnr_db"].Number(), 1) + "\u00a0dB, mask IoU " + FormatFixed(own["mask_iou"].Number(), 3);
  return ParagraphHtml(text + ".");
}

/// Folded; the studio in 3D shows it on the body.
std::string TextureAtlas(SectionContext* context, const Stage& stage) {
  const std::string images = ImagesOf(context, stage, kTextures);
  return images.empty() ? "" : DetailsHtml("Texture atlas", images);
}

std::string EvalBody(SectionContext* context, const Stage& stage) {
  const Value& metrics = stage.metrics();
  const std::string scores = ScoresTable(metrics) + Intervals(metrics);
  std::string html = StageHeading(context->data, stage) + ScoreLine(metrics) + CameraBars(metrics["per_camera"]);
  if (!scores.empty()) html += DetailsHtml("Scores and baselines", scores);
  const std::string cameras = ObjectsTable("", metrics["per_camera"]);
  if (!cameras.empty()) html += DetailsHtml("Scores of each camera", cameras);
  html += TextureAtlas(context, stage);
  const std::string all = NumbersTable("", metrics);
  return GridHtml({html, all.empty() ? "" : DetailsHtml("All numbers", all)}, "result");
}

}  // namespace

Section AvatarSection(SectionContext* context) {
  Section section{"avatar", "Avatar", ""};
  section.body_html += MethodsSideBySide(context) + FittedBodies(context);
  const std::vector<const Stage*> evaluations = context->data.All("avatar eval");
  for (const Stage* stage : evaluations) {
    const std::string body = EvalBody(context, *stage);
    section.body_html += evaluations.size() > 1 ? DetailsHtml("Scores and images of " + stage->file, body) : body;
  }
  for (const CsvFile& history : context->data.histories) {
    const std::string curves = Curves(context, history);
    section.body_html += context->data.histories.size() > 1 ? DetailsHtml("Training of " + history.file, curves) : curves;
  }
  for (const Stage& stage : context->data.stages) {
    if (stage.command != "avatar train" && stage.command != "avatar resume") continue;
    section.body_html += TextureAtlas(context, stage);
    for (const Value& output : stage.result["outputs"].items()) {
      const std::string player =
          output["role"].Text() == "gaussians-player" ? EmbedPlayer(context, stage, output) : std::string();
      if (!player.empty()) section.body_html += DetailsHtml("Gaussians in motion", player);
    }
    const std::string all = NumbersTable("", stage.metrics());
    if (!all.empty())
      section.body_html += DetailsHtml(
          "All numbers of the training" + (context->data.All(stage.command).size() > 1 ? " in " + stage.folder : ""), all);
  }
  if (section.body_html.empty()) {
    SetNotRun(&section, "Avatar",
              "mvstudio avatar train RUN/dataset --method tna --out RUN/avatar, then mvstudio avatar eval RUN/avatar");
  }
  return section;
}

}  // namespace mvstudio::report
