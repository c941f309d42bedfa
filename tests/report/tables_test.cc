#include <gtest/gtest.h>

#include "report/sections.h"
#include "tests/support/cpu_time.h"

namespace mvstudio::report {
namespace {

// A row a key would make a table of as many columns as rows.
TEST(ObjectsTable, HasAsManyColumnsAsAPageCanShow) {
  Value rows;
  for (int i = 0; i < 20000; ++i) rows.Append(Value().Set("k" + std::to_string(i), i));
  const double start = mvstudio::testing::CpuSeconds();
  const std::string html = ObjectsTable("rows", rows, {});
  EXPECT_NE(html.find("k0"), std::string::npos);
  EXPECT_LT(html.size(), 100u << 20);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20);
}

/// Two digits of a deviation of 0.0015 are the fourth decimal.
TEST(Tables, NumbersHaveTheDigitsThatTheirDeviationAllows) {
  const Value row = Value::Parse(R"({"readout_frames": 0.0024378109681, "readout_sigma_frames": 0.0015027560928,
                                     "scale": 1.000123456, "scale_sigma": 0.0213456, "rate_ppm": 12.3456789,
                                     "median_px": 0.123456789, "median_sigma_px": 0.9})",
                                 "row");
  for (const std::string& html : {NumbersTable("", row), ObjectsTable("", Value::Array().Append(row))}) {
    for (const char* cell : {">0.0024", ">0.0015", ">1.000", ">0.021", ">12.35", ">0.1235", ">0.90"}) {
      EXPECT_NE(html.find(cell), std::string::npos) << cell << " in " << html;
    }
    for (const char* cell : {"0.002438", "0.001503", "1.0001", "0.0213"}) EXPECT_EQ(html.find(cell), std::string::npos) << cell;
  }
}

}  // namespace
}  // namespace mvstudio::report
