#include "tests/avatar/panoptic_fixture.h"
#include "tests/avatar/script_nets.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// A TorchScript file is a program. A checkpoint may come from anywhere, so it names no such file: the command line does.
namespace mvstudio {
namespace {

TEST(PerceptualFile, IsNamedOnTheCommandLineAndNotByTheCheckpoint) {
  const testing::TempDir folder;
  const std::string data = folder / "data", run = folder / "run", net = folder / "net.pt";
  avatar::WriteMannequinDataset(data, 2, 3, 64);
  avatar::SaveScript(net, "\ndef forward(self, image):\n    return image * self.weight\n");
  const CliRun train = RunCli({"avatar", "train",
                               data,     "--out",
                               run,      "--size",
                               "32",     "--width",
                               "4",      "--downs",
                               "2",      "--encoder-blocks",
                               "1",      "--decoder-blocks",
                               "1",      "--init-steps",
                               "0",      "--steps",
                               "2",      "--perceptual",
                               net,      "--weight-perceptual",
                               "0.1",    "--no-fit-shape"});
  ASSERT_EQ(train.exit, 0) << train.err;
  const CliRun silent = RunCli({"avatar", "resume", run, "--steps", "3"});
  EXPECT_EQ(silent.exit, 2);
  EXPECT_THAT(silent.err, HasSubstr("such a file is a program: give it as --perceptual FILE"));
  const CliRun named = RunCli({"avatar", "resume", run, "--steps", "3", "--perceptual", net});
  EXPECT_EQ(named.exit, 0) << named.err;
}

}  // namespace
}  // namespace mvstudio
