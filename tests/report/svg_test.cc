#include "report/svg/svg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <regex>

#include "report/svg/axes.h"
#include "report/svg/canvas.h"
#include "report/svg/rig_view.h"
#include "tests/report/markup.h"

namespace mvstudio::report {
namespace {

using ::testing::DoubleEq;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

/// Every attribute `name` of `element` in a figure, as numbers.
std::vector<double> Attributes(const std::string& svg, const std::string& element, const std::string& name) {
  std::vector<double> found;
  const std::regex pattern("<" + element + "[^>]* " + name + "=\"([-0-9.e+]+)\"");
  for (std::sregex_iterator it(svg.begin(), svg.end(), pattern), end; it != end; ++it) found.push_back(std::stod((*it)[1]));
  return found;
}

TEST(CellGrid, DrawsItsCellsOverTheFrameAndShowsWhatIsMissing) {
  CellGridSpec spec;
  spec.title = "corners <&>";
  spec.rows = {{0, 4}, {2, kNan}};
  spec.zero_is_missing = true;
  const std::string svg = CellGrid(spec);
  const size_t frame = svg.find("class=\"frame\"");
  EXPECT_LT(frame, svg.find("class=\"h4\""));
  EXPECT_LT(frame, svg.find("class=\"f1\""));
  EXPECT_THAT(Attributes(svg, "rect", "width").size(), 4u) << "the frame and three cells";
  EXPECT_THAT(svg, HasSubstr("corners &lt;&amp;&gt;"));
}

TEST(CellGrid, EveryCellIsDrawnAlsoTheSmallestAndThoseWithoutANumber) {
  CellGridSpec spec;
  spec.rows = {{1, 0.01}, {kNan, kNan}};
  const std::string svg = CellGrid(spec);
  EXPECT_THAT(svg, HasSubstr("class=\"h0\""));
  EXPECT_EQ(Attributes(svg, "line", "x1").size(), 2u) << "struck out";
}

/// A ramp of 0 to 0.9 over ten columns: the line of 0.5 is upright, in the middle of the sixth.
TEST(CellGrid, ContoursStandWhereTheFieldHasTheirValue) {
  CellGridSpec spec;
  spec.rows.assign(4, {});
  for (auto& row : spec.rows) {
    for (int c = 0; c < 10; ++c) row.push_back(0.1 * c);
  }
  spec.full = 1, spec.contours = true, spec.unit = "px", spec.decimals = 2, spec.width = 408;  // cells of 40 px from 4 on
  const std::string svg = CellGrid(spec);
  EXPECT_EQ(CheckMarkup(svg), "");
  for (const char* text : {">0.1<", ">0.2<", ">0.5<", ">0.8<", ">px<"}) EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_THAT(svg, Not(HasSubstr("text-anchor=\"middle\">0.90<"))) << "lines instead of numbers";
  bool found = false;
  const std::regex path("<path d=\"(M[^\"]*)\" class=\"err\""), number("M([0-9.]+) ");
  for (std::sregex_iterator it(svg.begin(), svg.end(), path), end; it != end; ++it) {
    const std::string line = (*it)[1];
    std::vector<double> x;
    for (std::sregex_iterator at(line.begin(), line.end(), number); at != end; ++at) x.push_back(std::stod((*at)[1]));
    ASSERT_EQ(x.size(), 3u) << "between four rows";
    found |= std::all_of(x.begin(), x.end(), [](double v) { return std::fabs(v - (4 + 5.5 * 40)) < 0.5; });
  }
  EXPECT_TRUE(found);
}

/// The left edge, right edge and base line of each text with a halo.
std::vector<std::array<double, 3>> LabelsOf(const std::string& svg) {
  std::vector<std::array<double, 3>> labels;
  const std::regex text("<text x=\"([-0-9.]+)\" y=\"([-0-9.]+)\" class=\"x halo\"( text-anchor=\"([a-z]+)\")?>([^<]*)<");
  for (std::sregex_iterator it(svg.begin(), svg.end(), text), end; it != end; ++it) {
    const double x = std::stod((*it)[1]), width = 5.5 * static_cast<double>((*it)[5].length());
    const std::string anchor = (*it)[4];
    const double left = anchor == "end" ? x - width : anchor == "middle" ? x - width / 2 : x;
    labels.push_back({left, left + width, std::stod((*it)[2])});
  }
  return labels;
}

void ExpectApart(const std::vector<std::array<double, 3>>& labels) {
  for (size_t i = 0; i < labels.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      const bool beside = labels[i][1] <= labels[k][0] + 1 || labels[k][1] <= labels[i][0] + 1;
      EXPECT_TRUE(beside || std::fabs(labels[i][2] - labels[k][2]) > 10) << i << " and " << k;
    }
  }
}

TEST(ParetoChart, NamesStandBesideTheirPointsAndDoNotCross) {
  ParetoChartSpec spec;
  for (int i = 0; i < 4; ++i) {
    spec.points.push_back({"a long name of method " + std::to_string(i), 1 + 0.01 * i, 1 - 0.01 * i, true});
  }
  spec.points.push_back({"far", 100, 0.1, true});
  spec.points.push_back({"poor", 100, 3, false});
  const std::string svg = ParetoChart(spec);
  const auto labels = LabelsOf(svg);
  const std::vector<double> x = Attributes(svg, "circle", "cx"), y = Attributes(svg, "circle", "cy");
  ASSERT_EQ(labels.size(), 5u);
  ExpectApart(labels);
  for (size_t i = 0; i < labels.size(); ++i) {
    const double aside = std::max({0.0, labels[i][0] - x[i], x[i] - labels[i][1]});
    EXPECT_LT(std::hypot(aside, labels[i][2] - 4 - y[i]), 40) << i;
    EXPECT_LT(labels[i][1], spec.width);
  }
}

TEST(RigView, NamesOfCamerasThatStandTogetherDoNotCross) {
  std::vector<ViewCamera> cameras(6);
  for (int i = 0; i < 6; ++i) {
    SetPose({0.5, -0.5, 0.5, 0.5}, {0, 0, 0}, &cameras[i]);
    cameras[i].center_in_world = {i < 3 ? 0.05 * i : 4 + 0.05 * i, 0, 1 + 0.02 * i};  // two groups
    cameras[i].name = "camera_" + std::to_string(i);
  }
  for (const std::string& svg : {RigTopView(cameras, {}), RigCornerView(cameras, {})}) {
    EXPECT_EQ(CheckMarkup(svg), "");
    EXPECT_EQ(LabelsOf(svg).size(), 6u);
    ExpectApart(LabelsOf(svg));
  }
}

/// 1.8 m of person fill most of a figure of their own, in which a rig of 8 m leaves them a fifth.
TEST(SubjectView, ThePoseIsAsLargeAsItsFigure) {
  std::vector<ViewCamera> cameras(2);
  SetPose({0.5, -0.5, 0.5, 0.5}, {0, 0, 0}, &cameras[0]);
  cameras[1] = cameras[0];
  cameras[1].center_in_world = {8, 0, 1};
  ViewSubject subject;
  EXPECT_EQ(SubjectView(cameras, subject), "");
  subject.bones = {{{4, 0, 0}, {4, 0, 1.8}, ""}};
  const std::string svg = SubjectView(cameras, subject, 300);
  EXPECT_EQ(CheckMarkup(svg), "");
  std::smatch bone;
  ASSERT_TRUE(std::regex_search(svg, bone,
                                std::regex("d=\"M([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)\" class=\"err\" stroke-width=\"2\"")));
  EXPECT_GT(std::fabs(std::stod(bone[4]) - std::stod(bone[2])), 120);
  EXPECT_EQ(svg.find("<polygon"), std::string::npos) << "no cameras";
}

TEST(ParetoChart, WhatStandsOutIsNamedOffTheFront) {
  ParetoChartSpec spec;
  spec.points = {{"best", 1, 1, true},
                 {"usual", 2, 2, false, PointStyle::kRinged},
                 {"peer", 3, 3, false, PointStyle::kSquare},
                 {"other", 4, 4, false}};
  const std::string svg = ParetoChart(spec);
  EXPECT_THAT(svg, HasSubstr(">best</text>"));
  EXPECT_THAT(svg, HasSubstr(">usual</text>"));
  EXPECT_THAT(svg, HasSubstr(">peer</text>"));
  EXPECT_THAT(svg, Not(HasSubstr(">other</text>")));
  EXPECT_THAT(svg, HasSubstr("<rect")) << "the square";
  spec.points[2].style = PointStyle::kDot;
  EXPECT_THAT(ParetoChart(spec), Not(HasSubstr("<rect")));
}

TEST(ParetoChart, NamesTheFrontOnly) {
  ParetoChartSpec spec;
  spec.points = {{"fast", 1, 3, true}, {"exact", 10, 1, true}, {"poor", 10, 3, false}, {"lost", kNan, 1, false}};
  const std::string svg = ParetoChart(spec);
  EXPECT_THAT(svg, HasSubstr(">fast<"));
  EXPECT_THAT(svg, HasSubstr(">exact<"));
  EXPECT_THAT(svg, Not(HasSubstr(">poor<")));
  EXPECT_EQ(Attributes(svg, "circle", "cx").size(), 3u);
}

TEST(NiceTicks, AreRoundAndInside) {
  EXPECT_THAT(NiceTicks(0, 10, 5), ElementsAre(0, 2, 4, 6, 8, 10));
  EXPECT_THAT(NiceTicks(-1, 1, 4), ElementsAre(DoubleEq(-1), DoubleEq(-0.5), DoubleEq(0), DoubleEq(0.5), DoubleEq(1)));
  EXPECT_THAT(NiceTicks(0.03, 0.11, 4),
              ElementsAre(DoubleNear(0.04, 1e-12), DoubleNear(0.06, 1e-12), DoubleNear(0.08, 1e-12), DoubleNear(0.1, 1e-12)));
}

TEST(NiceTicks, NeverMinusZero) {
  for (const double tick : NiceTicks(-0.3, 0.3, 6)) EXPECT_FALSE(tick == 0 && std::signbit(tick));
}

TEST(NiceTicks, StepIsOneTwoOrFiveOverManyRanges) {
  for (double span = 1e-9; span < 1e12; span *= 3.7) {
    const std::vector<double> ticks = NiceTicks(0.37 * span, 1.37 * span, 6);
    ASSERT_GE(ticks.size(), 3u) << span;
    ASSERT_LE(ticks.size(), 11u) << span;
    const double step = ticks[1] - ticks[0], mantissa = step / std::pow(10.0, std::floor(std::log10(step) + 1e-9));
    EXPECT_TRUE(std::fabs(mantissa - 1) < 1e-6 || std::fabs(mantissa - 2) < 1e-6 || std::fabs(mantissa - 5) < 1e-6) << mantissa;
    EXPECT_GE(ticks.front(), 0.37 * span * (1 - 1e-9));
    EXPECT_LE(ticks.back(), 1.37 * span * (1 + 1e-9));
  }
}

TEST(NiceTicks, DegenerateRangesEnd) {
  EXPECT_THAT(NiceTicks(3, 3), ElementsAre(3));
  EXPECT_THAT(NiceTicks(kNan, 1), IsEmpty());
  EXPECT_THAT(NiceTicks(0, kInf), IsEmpty());
  EXPECT_THAT(NiceTicks(1, 0), IsEmpty());
  // One unit in the last place apart: labels could not be told apart.
  EXPECT_EQ(NiceTicks(1e6, std::nextafter(1e6, 2e6)).size(), 1u);
}

TEST(LogTicks, PowersAndTheirParts) {
  EXPECT_THAT(LogTicks(0.1, 10),
              ElementsAre(DoubleNear(0.1, 1e-15), DoubleNear(0.2, 1e-15), DoubleNear(0.5, 1e-15), 1, 2, 5, 10));
  EXPECT_THAT(LogTicks(1e-6, 1e2), ElementsAre(1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1, 10, 100));
  EXPECT_THAT(LogTicks(0, 1), IsEmpty());
  EXPECT_THAT(LogTicks(-1, 1), IsEmpty());
}

TEST(TickLabel, AsManyDecimalsAsTheStepNeeds) {
  EXPECT_EQ(TickLabel(0.1 + 0.2, 0.1), "0.3");
  EXPECT_EQ(TickLabel(0.25, 0.05), "0.25");
  EXPECT_EQ(TickLabel(400, 200), "400");
  EXPECT_EQ(TickLabel(1, 0.5), "1.0");
  EXPECT_EQ(TickLabel(0, 0.2), "0.0");
  EXPECT_EQ(TickLabel(1e-3, 0), "0.001");
  EXPECT_EQ(TickLabel(kNan, 1), "\u2013");
}

TEST(NiceBelow, LargestRoundNumberNotAbove) {
  EXPECT_DOUBLE_EQ(NiceBelow(1), 1);
  EXPECT_DOUBLE_EQ(NiceBelow(1.99), 1);
  EXPECT_DOUBLE_EQ(NiceBelow(2), 2);
  EXPECT_DOUBLE_EQ(NiceBelow(0.07), 0.05);
  EXPECT_DOUBLE_EQ(NiceBelow(1000), 1000);
  EXPECT_DOUBLE_EQ(NiceBelow(0), 1);
}

TEST(Scale, MapsEndsAndMiddle) {
  const Scale linear({"", false, true}, {0, 10}, 100, 300);
  EXPECT_DOUBLE_EQ(linear(0), 100);
  EXPECT_DOUBLE_EQ(linear(10), 300);
  EXPECT_DOUBLE_EQ(linear(5), 200);
  EXPECT_TRUE(std::isnan(linear(kNan)));
  const Scale logarithmic({"", true, false}, {0.01, 100}, 0, 1000);
  ASSERT_TRUE(logarithmic.log());
  EXPECT_NEAR(logarithmic(1), 500, 1e-9 * 500 + 6);  // the range is opened by 10 % on both sides
  EXPECT_NEAR(logarithmic(10) - logarithmic(1), logarithmic(1) - logarithmic(0.1), 1e-9);
  EXPECT_TRUE(std::isnan(logarithmic(0)));
}

TEST(Scale, LogarithmFallsBackWhenValuesAreNotPositive) {
  EXPECT_FALSE(Scale({"", true, false}, {0, 1, 10}, 0, 100).log());
  EXPECT_FALSE(Scale({"", true, false}, {-1, 10}, 0, 100).log());
}

TEST(Scale, NoValuesOrOneValueStillGiveARange) {
  for (const std::vector<double>& values : {std::vector<double>{}, {kNan}, {0.0}, {7.0}, {-3e8}}) {
    const Scale scale({"", false, false}, values, 0, 100);
    EXPECT_TRUE(std::isfinite(scale(values.empty() || std::isnan(values[0]) ? 0.5 : values[0])));
    EXPECT_LT(scale.low(), scale.high());
  }
}

TEST(LineChart, DrawsFiniteStretchesOnly) {
  LineChartSpec spec;
  spec.title = "loss <b> & \"co\"";
  spec.x.label = "step";
  spec.y.label = "loss";
  spec.series = {{"a", {0, 1, 2, 3, 4}, {1, 2, kNan, 4, 5}}, {"b", {0, 1}, {kInf, kNan}}};
  spec.markers = {{2, "train"}};
  const std::string svg = LineChart(spec);
  EXPECT_EQ(CheckMarkup(svg), "");
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf\"")));
  // Two stretches: two pen-downs in one path of series 0.
  std::smatch path;
  ASSERT_TRUE(std::regex_search(svg, path, std::regex("<path d=\"(M[^\"]*)\" class=\"s0\"")));
  const std::string d = path[1];
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'L'), 2);
}

TEST(BarChart, LengthsAreProportionalToValues) {
  BarChartSpec spec;
  spec.title = "t";
  spec.labels = {"a", "b", "c"};
  spec.series = {{"", {1, 2, kNan}, {}}};
  const std::string svg = BarChart(spec);
  EXPECT_EQ(CheckMarkup(svg), "");
  const std::vector<double> widths = Attributes(svg, "rect", "width");
  ASSERT_EQ(widths.size(), 2u);  // NaN has no bar
  EXPECT_NEAR(widths[1] / widths[0], 2, 1e-3);
  EXPECT_THAT(svg, HasSubstr("\u2013"));
}

TEST(BarChart, NegativeValuesGoTheOtherWay) {
  BarChartSpec spec;
  spec.labels = {"a", "b"};
  spec.series = {{"", {-1, 1}, {}}};
  const std::string svg = BarChart(spec);
  const std::vector<double> x = Attributes(svg, "rect", "x"), widths = Attributes(svg, "rect", "width");
  ASSERT_EQ(x.size(), 2u);
  EXPECT_NEAR(x[0] + widths[0], x[1], 0.02);  // both start at zero
}

TEST(StackedBar, SharesAddUp) {
  const std::string svg = StackedBar("s", {{"Ok", 75, 2}, {"Outlier", 25, 1}, {"none", 0, 3}}, 404);
  EXPECT_EQ(CheckMarkup(svg), "");
  EXPECT_THAT(svg, HasSubstr("Ok 75 (75.0%)"));
  EXPECT_THAT(svg, HasSubstr("Outlier 25 (25.0%)"));
  EXPECT_EQ(Attributes(svg, "rect", "width")[0], 300);
}

TEST(Histogram, CountsEveryFiniteValue) {
  const std::string svg = Histogram("h", {"error (px)", false, false}, {0.1, 0.2, 0.2, kNan, 5, kInf});
  EXPECT_EQ(CheckMarkup(svg), "");
  double total = 0;
  const std::regex count("<title>[^<]*: ([0-9]+)</title>");
  for (std::sregex_iterator it(svg.begin(), svg.end(), count), end; it != end; ++it) total += std::stod((*it)[1]);
  EXPECT_EQ(total, 4);
}

TEST(ResidualField, EqualAspectAndYDown) {
  // A dot in the lower right quarter of a 4:3 image and one in the upper left.
  const std::string svg = ResidualField("r", 640, 480, {{480, 360, 1, 0}, {160, 120, 0, 1}}, 400);
  EXPECT_EQ(CheckMarkup(svg), "");
  const double frame_width = Attributes(svg, "rect", "width")[0], frame_height = Attributes(svg, "rect", "height")[0];
  EXPECT_NEAR(frame_width / frame_height, 640.0 / 480.0, 1e-3);
  std::smatch dots;
  ASSERT_TRUE(std::regex_search(svg, dots, std::regex("d=\"M([0-9.]+) ([0-9.]+)h0M([0-9.]+) ([0-9.]+)h0\"")));
  const double x1 = std::stod(dots[1]), y1 = std::stod(dots[2]), x2 = std::stod(dots[3]), y2 = std::stod(dots[4]);
  EXPECT_NEAR((x1 - x2) / (y1 - y2), 320.0 / 240.0, 1e-3);
  EXPECT_GT(y1, y2);  // y grows downwards
}

TEST(ResidualField, NeedleHasTheStatedEnlargement) {
  const std::string svg = ResidualField("r", 1000, 500, {{500, 250, 2, 1}}, 566);  // half a canvas px an image px
  std::smatch needle, factor;
  ASSERT_TRUE(std::regex_search(svg, factor, std::regex("enlarged \u00d7([0-9.]+)")));
  ASSERT_TRUE(std::regex_search(svg, needle, std::regex("d=\"M([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)\" class=\"s0\"")));
  EXPECT_NEAR(std::stod(needle[3]) - std::stod(needle[1]), 2 * 0.5 * std::stod(factor[1]), 0.02);
  EXPECT_NEAR(std::stod(needle[4]) - std::stod(needle[2]), 1 * 0.5 * std::stod(factor[1]), 0.02);
}

TEST(ResidualField, NothingOrZeroOrNan) {
  for (const std::vector<ImageArrow>& arrows :
       {std::vector<ImageArrow>{}, {{1, 1, 0, 0}}, {{kNan, 1, 1, 1}}, {{1, 1, kInf, 0}}}) {
    for (const double width : {640.0, 0.0, kNan}) {
      EXPECT_EQ(CheckMarkup(ResidualField("r", width, 480, arrows)), "");
      EXPECT_EQ(CheckMarkup(ResidualCloud("r", arrows)), "");
    }
  }
}

TEST(VectorTargets, ArrowPointsWhereTheVectorPoints) {
  const std::string svg = VectorTargets("v", {{"left<", -4, 0}, {"down", 0, 2}}, 3);
  EXPECT_EQ(CheckMarkup(svg), "");
  EXPECT_THAT(svg, HasSubstr("left&lt;"));
  EXPECT_THAT(svg, HasSubstr("4\u00a0px"));
  std::smatch line;
  ASSERT_TRUE(std::regex_search(
      svg, line, std::regex("<line x1=\"([0-9.]+)\" y1=\"([0-9.]+)\" x2=\"([0-9.]+)\" y2=\"([0-9.]+)\" class=\"s1\"")));
  EXPECT_LT(std::stod(line[3]), std::stod(line[1]));  // the suspect one goes left
  ASSERT_TRUE(std::regex_search(
      svg, line, std::regex("<line x1=\"([0-9.]+)\" y1=\"([0-9.]+)\" x2=\"([0-9.]+)\" y2=\"([0-9.]+)\" class=\"s0\"")));
  EXPECT_GT(std::stod(line[4]), std::stod(line[2]));  // y down
}

TEST(HeatMap, RunsAreMerged) {
  HeatMapSpec spec;
  spec.title = "h";
  spec.column_label = "frame";
  spec.row_names = {"Nose"};
  spec.last_column = 5;
  spec.rows = {{1, 1, 0, 0, kNan, 1}};
  const std::string svg = HeatMap(spec);
  EXPECT_EQ(CheckMarkup(svg), "");
  EXPECT_EQ(Attributes(svg, "rect", "width").size(), 1u + 3u);  // frame and three runs
}

TEST(SetPose, CentreAndAxesOfAKnownPose) {
  // Camera at (1, 2, 3) that looks along world +x with the image's down along world -z: right is world -y.
  ViewCamera camera;
  const double h = 0.5;  // quaternion of rows (0,-1,0), (0,0,-1), (1,0,0)
  SetPose({h, -h, h, h}, {2, 3, -1}, &camera);
  const double forward[3] = {camera.world_from_cam[0][2], camera.world_from_cam[1][2], camera.world_from_cam[2][2]};
  EXPECT_NEAR(forward[0], 1, 1e-12);
  EXPECT_NEAR(camera.world_from_cam[2][1], -1, 1e-12);
  EXPECT_NEAR(camera.world_from_cam[1][0], -1, 1e-12);
  EXPECT_NEAR(camera.center_in_world[0], 1, 1e-12);
  EXPECT_NEAR(camera.center_in_world[1], 2, 1e-12);
  EXPECT_NEAR(camera.center_in_world[2], 3, 1e-12);
}

TEST(UpAxis, FollowsTheCameras) {
  ViewCamera level;
  SetPose({0.5, -0.5, 0.5, 0.5}, {0, 0, 0}, &level);
  EXPECT_EQ(UpAxis({level}), 3);
  ViewCamera identity;  // a stereo rig in its left camera's frame: y is down
  SetPose({0, 0, 0, 1}, {0, 0, 0}, &identity);
  EXPECT_EQ(UpAxis({identity, identity}), -2);
  EXPECT_EQ(UpAxis({}), 3);
}

TEST(RigView, TopViewKeepsDistancesAndIsNotMirrored) {
  // Three cameras; seen from above with x right and y up, b is right of a and c is above a.
  std::vector<ViewCamera> cameras(3);
  const Vector3 centres[] = {{0, 0, 1}, {4, 0, 2}, {0, 2, 3}};
  for (int i = 0; i < 3; ++i) {
    SetPose({0.5, -0.5, 0.5, 0.5}, {0, 0, 0}, &cameras[i]);
    cameras[i].center_in_world = centres[i];
    cameras[i].name = std::string("cam & ") + "abc"[i];
  }
  const std::string svg = RigTopView(cameras, {});
  EXPECT_EQ(CheckMarkup(svg), "");
  const std::vector<double> x = Attributes(svg, "circle", "cx"), y = Attributes(svg, "circle", "cy");
  ASSERT_EQ(x.size(), 3u);
  EXPECT_GT(x[1], x[0] + 1);
  EXPECT_LT(y[2], y[0] - 1);
  EXPECT_NEAR((x[1] - x[0]) / (y[0] - y[2]), 2, 0.01);  // 4 m against 2 m: equal scale
  EXPECT_EQ(CheckMarkup(RigCornerView(cameras, {})), "");
}

TEST(RigView, NothingNanAndCoincident) {
  EXPECT_EQ(CheckMarkup(RigTopView({}, {})), "");
  std::vector<ViewCamera> cameras(2);
  SetPose({0, 0, 0, 0}, {kNan, 0, 0}, &cameras[0]);
  SetPose({0, 0, 0, 1}, {0, 0, 0}, &cameras[1]);
  ViewSubject subject;
  subject.path = {{kNan, kNan, kNan}, {0, 0, 1}};
  EXPECT_EQ(CheckMarkup(RigTopView(cameras, subject)), "");
  EXPECT_EQ(CheckMarkup(RigCornerView({cameras[1], cameras[1]}, subject)), "");
  // A metre apart, so far from the origin that the next double is metres away.
  for (const double far : {1e17, 1e200}) {
    cameras[0] = cameras[1];
    cameras[0].center_in_world = {far, 0, 0};
    cameras[1].center_in_world = {far, 1, 0};
    EXPECT_EQ(CheckMarkup(RigTopView(cameras, {})), "");
  }
}

TEST(RigView, BonesHaveTheColoursOfTheirSkeleton) {
  std::vector<ViewCamera> cameras(2);
  SetPose({0, 0, 0, 1}, {0, 0, 0}, &cameras[0]);
  SetPose({0, 0, 0, 1}, {1, 2, 0}, &cameras[1]);
  ViewSubject subject;
  subject.bones = {{{0, 0, 0}, {0, 1, 0}, "#ff8800"}, {{0, 0, 0}, {1, 0, 0}, ""}, {{0, 0, 0}, {0, 0, 1}, "\"><b>"}};
  const std::string svg = RigTopView(cameras, subject);
  EXPECT_EQ(CheckMarkup(svg), "");
  EXPECT_NE(svg.find("style=\"stroke:#ff8800\""), std::string::npos);
  EXPECT_EQ(svg.find("<b>"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::report
