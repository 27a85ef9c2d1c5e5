//! What every client may see and do.

use std::sync::Arc;

use masseter_recording::Scene;
use masseter_runtime::named::Declared;
use masseter_runtime::transport::Domain;

use super::feed::Feed;
use super::supervisor::Supervisor;

/// The secret that clients must name, the run's scene, signals and parameters, its page, and who ends the run.
#[derive(Debug, Clone)]
pub(super) struct Host {
    pub secret: String,
    pub scene: Scene,
    pub declared: Arc<Declared>,
    pub domain: Domain,
    pub feed: Arc<Feed>,
    pub supervisor: Supervisor,
}
