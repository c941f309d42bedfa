#include "stages/fronts/fronts.h"

#include <algorithm>
#include <limits>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/value.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::stages {
namespace {

using report::Value;

Value WayValue(const FrontWay& way) {
  Value value = Value::Object();
  value.Set("name", way.name).Set("mark", std::string(ToString(way.mark))).Set("command", way.command);
  value.Set("seconds", way.seconds).Set("processor_seconds", way.cpu_s).Set("peak_rss_mb", way.peak_rss_mb);
  value.Set("stored_kib", way.stored_kib).Set("error", way.error).Set("why_not", way.why_not);
  return value;
}

Value NumbersValue(const std::vector<double>& numbers) {
  Value value = Value::Array();
  for (const double number : numbers) value.Append(number);
  return value;
}

std::vector<double> NumbersFrom(const Value& value) {
  std::vector<double> numbers;
  for (const Value& number : value.items()) numbers.push_back(number.Number());
  return numbers;
}

Value GrowthValue(const GrowthRow& row) {
  Value value = Value::Object();
  value.Set("stage", row.stage).Set("axis", row.axis).Set("factors", NumbersValue(row.factors));
  value.Set("processor_seconds", NumbersValue(row.cpu_s)).Set("peak_rss_mb", NumbersValue(row.peak_rss_mb));
  value.Set("error", NumbersValue(row.error)).Set("exponent", row.exponent).Set("why_not", row.why_not);
  return value;
}

GrowthRow GrowthFrom(const Value& value) {
  GrowthRow row;
  row.stage = value["stage"].Text(), row.axis = value["axis"].Text(), row.why_not = value["why_not"].Text();
  row.factors = NumbersFrom(value["factors"]), row.cpu_s = NumbersFrom(value["processor_seconds"]);
  row.peak_rss_mb = NumbersFrom(value["peak_rss_mb"]), row.error = NumbersFrom(value["error"]);
  const size_t n = std::min({row.factors.size(), row.cpu_s.size(), row.peak_rss_mb.size(), row.error.size()});
  for (auto* numbers : {&row.factors, &row.cpu_s, &row.peak_rss_mb, &row.error}) numbers->resize(n);
  FinishGrowth(&row);
  return row;
}

WayMark MarkOf(const std::string& word) { return ChoiceOf(kWayMarkWords, word).value_or(WayMark::kNone); }

FrontWay WayFrom(const Value& value) {
  FrontWay way;
  way.name = value["name"].Text(), way.mark = MarkOf(value["mark"].Text()), way.command = value["command"].Text();
  way.seconds = value["seconds"].Number(), way.cpu_s = value["processor_seconds"].Number();
  way.peak_rss_mb = value["peak_rss_mb"].Number(), way.stored_kib = value["stored_kib"].Number();
  way.error = value["error"].Number(), way.why_not = value["why_not"].Text();
  return way;
}

StageFront FrontFrom(const Value& value) {
  StageFront front;
  front.stage = value["stage"].Text(), front.cost = value["cost"].Text(), front.error = value["error"].Text();
  front.space = value["space"].Text(), front.why_not = value["why_not"].Text();
  for (const Value& way : value["ways"].items()) front.ways.push_back(WayFrom(way));
  MarkFronts(&front);
  return front;
}

}  // namespace

void MarkFronts(StageFront* front) {
  std::vector<TradeoffPoint> time, space;
  for (const FrontWay& way : front->ways) {
    time.push_back({way.name, way.time(), way.error}), space.push_back({way.name, way.space(), way.error});
  }
  const std::vector<bool> in_time = ParetoFront(time), in_space = ParetoFront(space);
  for (size_t i = 0; i < front->ways.size(); ++i)
    front->ways[i].time_front = in_time[i], front->ways[i].space_front = in_space[i];
  const auto failed = [](const FrontWay& way) { return !way.why_not.empty(); };
  if (!front->ways.empty() && front->why_not.empty() && std::all_of(front->ways.begin(), front->ways.end(), failed))
    front->why_not = front->ways.front().why_not;
}

std::string FrontsJson(const Fronts& fronts) {
  Value stages = Value::Array();
  for (const StageFront& front : fronts.stages) {
    Value ways = Value::Array();
    for (const FrontWay& way : front.ways) ways.Append(WayValue(way));
    Value value = Value::Object();
    value.Set("stage", front.stage).Set("cost", front.cost).Set("error", front.error).Set("space", front.space);
    value.Set("why_not", front.why_not).Set("ways", ways);
    stages.Append(value);
  }
  Value machine = Value::Object();
  machine.Set("processor", fronts.processor).Set("cores", fronts.cores).Set("load", fronts.load);
  Value value = Value::Object();
  value.Set("schema", kFrontsSchema).Set("footage", fronts.footage).Set("machine", machine);
  value.Set("threads", fronts.threads).Set("seed", static_cast<int64_t>(fronts.seed)).Set("stages", stages);
  Value growth = Value::Array();
  for (const GrowthRow& row : fronts.growth) growth.Append(GrowthValue(row));
  value.Set("grown", fronts.grown).Set("growth", growth);
  return value.Dump(1) + "\n";
}

Fronts ReadFronts(const std::string& path) {
  const Value value = Value::Parse(ReadFile(path), path);
  if (value["schema"].Text() != kFrontsSchema)
    throw FormatError(path, "schema", std::string("is not ") + kFrontsSchema + ": give the results of `mvstudio tradeoff all`");
  Fronts fronts;
  fronts.footage = value["footage"].Text(), fronts.processor = value["machine"]["processor"].Text();
  fronts.load = value["machine"]["load"].Number();
  const auto whole = [](const Value& number) {
    const double is = number.Number(0);
    return is > 0 && is < std::numeric_limits<int>::max() ? static_cast<int>(is) : 0;
  };
  fronts.cores = whole(value["machine"]["cores"]), fronts.threads = whole(value["threads"]);
  fronts.seed = static_cast<unsigned long long>(value["seed"].integer());
  for (const Value& stage : value["stages"].items()) fronts.stages.push_back(FrontFrom(stage));
  fronts.grown = value["grown"].Text();
  for (const Value& row : value["growth"].items()) fronts.growth.push_back(GrowthFrom(row));
  return fronts;
}

}  // namespace mvstudio::stages
