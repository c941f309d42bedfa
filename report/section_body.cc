#include "report/page/format.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

/// The object of named objects as an array with the names as a column.
Value WithNames(const Value& objects) {
  Value rows = Value::Array();
  for (const auto& [name, object] : objects.fields()) {
    Value row = Value::Object().Set("name", name);
    for (const auto& [key, value] : object.fields()) row.Set(key, value);
    rows.Append(row);
  }
  return rows;
}

/// What the fit of a body found; `metrics` of `avatar fit`, or what `avatar train` keeps of its own fit.
std::string BodyTables(const Value& metrics) {
  std::string html = FoldedTable("Steps of the fit, by held-out silhouettes", metrics["stages"]);
  html += FoldedTable("Silhouettes of each camera", WithNames(metrics["cameras"]));
  const Value& templates = metrics["templates"];
  if (templates.items().size() > 1) html += ObjectsTable("Templates", templates);
  const Value& sigma = metrics["surface_sigma_mm"];
  if (sigma.IsObject()) {
    html += ParagraphHtml("Standard deviation of the surface: " + FormatFixed(sigma["median"].Number(), 1) +
                              "\u00a0mm in the median, " + FormatFixed(sigma["quantile_95"].Number(), 1) +
                              "\u00a0mm at 95\u00a0%. Known to 10\u00a0mm: " +
                              FormatFixed(100 * sigma["share_below_10"].Number(), 0) + "\u00a0% of the vertices.",
                          "");
  }
  return html;
}

std::string FitBody(SectionContext* context, const Stage& stage) {
  const Value& metrics = stage.metrics();
  std::string html = StageHeading(context->data, stage) + BodyTables(metrics);
  const Value& limits = metrics["surface_maps"];
  for (const Value& output : stage.result["outputs"].items()) {
    if (output["role"].Text() != "surface-maps") continue;
    html += EmbedOutput(context, stage, output,
                        "The surface off the template's (blue " + FormatFixed(-limits["offset_limit_mm"].Number(), 0) +
                            "\u00a0mm, red " + FormatFixed(limits["offset_limit_mm"].Number(), 0) +
                            "\u00a0mm; dark where it is not known), and its standard deviation (red " +
                            FormatFixed(limits["sigma_limit_mm"].Number(), 0) + "\u00a0mm and more)",
                        {"front", "back", "front, deviation", "back, deviation"});
  }
  return GridHtml({html}, "result");
}

}  // namespace

std::string FittedBodies(SectionContext* context) {
  std::string html;
  for (const Stage& stage : context->data.stages) {
    if (stage.command == "avatar fit") html += FitBody(context, stage);
    if (stage.command == "avatar train" && stage.metrics()["body"].IsObject())
      html += GridHtml({"<h3>Fitted body</h3>\n", BodyTables(stage.metrics()["body"])}, "result");
  }
  return html;
}

}  // namespace mvstudio::report
