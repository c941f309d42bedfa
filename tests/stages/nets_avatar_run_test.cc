#include <filesystem>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/nets/avatar_run.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

TEST(AvatarRun, ATrainedAvatarIsNotReplacedUnasked) {
  const TempDir folder;
  const AvatarRun run(folder / "run");
  EXPECT_NO_THROW(run.RequireFree(false));
  Put(run.Path("notes.txt"), "mine");
  EXPECT_NO_THROW(run.RequireFree(false)) << "no checkpoint is there";
  Put(run.checkpoint_path(), "weights");
  const std::string message = MessageOf<UsageError>([&] { run.RequireFree(false); });
  EXPECT_THAT(message, HasSubstr("option 'out' " + (folder / "run")));
  EXPECT_THAT(message, HasSubstr("option 'overwrite'"));
  EXPECT_NO_THROW(run.RequireFree(true));
}

TEST(AvatarRun, NamesAreDifferentAndHoldWhatIsWritten) {
  const std::vector<std::string> names = AvatarRun::Names();
  const std::set<std::string> different(names.begin(), names.end());
  EXPECT_EQ(different.size(), names.size());
  for (const char* name : {"checkpoint.safetensors", "config.json", "history.csv", "textures.png", "samples", "pictures",
                           "avatar_eval.result.json", "protocol.json", "eval", "pretrain.json"}) {
    EXPECT_EQ(different.count(name), 1u) << name;
  }
}

TEST(AvatarRun, ClearingTakesOurFilesAndNobodyElses) {
  const TempDir folder;
  const AvatarRun run(folder / "run");
  for (const char* ours : {"history.csv", "samples/step_000100.png", "eval/render/x.png", "protocol.json"}) {
    WriteFileAtomic(run.Path(ours), std::string("ours"));
  }
  Put(run.Path("notes.txt"), "mine");
  run.ForgetScores();
  EXPECT_FALSE(fs::exists(run.Path("eval")) || fs::exists(run.Path("protocol.json")));
  EXPECT_TRUE(fs::exists(run.Path("history.csv")) && fs::exists(run.Path("samples/step_000100.png")));
  Put(run.Path("samples/drawing.png"), "mine");
  EXPECT_THAT(MessageOf<UsageError>([&] { run.Clear(); }), HasSubstr("drawing.png"));
  EXPECT_TRUE(fs::exists(run.Path("history.csv"))) << "nothing is removed when something is in the way";
  fs::remove(run.Path("samples/drawing.png"));
  run.Clear();
  EXPECT_FALSE(fs::exists(run.Path("history.csv")) || fs::exists(run.Path("samples")));
  EXPECT_EQ(ReadFile(run.Path("notes.txt")), "mine");
}

}  // namespace
}  // namespace mvstudio::stages
