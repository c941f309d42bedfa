#include "dataset/verify/verify.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

TEST(VerifyIntegration, ForeignDatasetIsFoundSound) {
  MVS_NEEDS_DATA("person_a");
  const VerifyReport report = VerifyDataset(DataFolder("person_a"));
  for (const Finding& f : report.findings) ADD_FAILURE() << f.code << " " << f.path << ": " << f.text;
  EXPECT_EQ(report.cameras, 10);
  EXPECT_EQ(report.frames, 120);
  EXPECT_EQ(report.images, 1200);
  EXPECT_EQ(report.masks, 1200);
}

}  // namespace
}  // namespace mvstudio::dataset
