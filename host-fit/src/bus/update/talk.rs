//! Requests and their answers over a bus that may lose either.

use super::UpdateError;
use hal_adapters::can::command::{Command, Content, Mailbox, Outcome, Request};
use hal_adapters::can::update::{Key, Nonce, TAG_INDEX, UpdateData, UpdateRequest, tag, word_at};
use hal_adapters::can::{BusFrame, NodeNumber};

/// From frame to frame, us. A controller stores three received frames and reads them every 2 ms. At one frame
/// in a millisecond none is lost, even to a tick that is late.
pub const SPACING_US: u64 = 1_000;
/// Wait for an answer before the request is repeated, us.
const PATIENCE_US: u64 = 100_000;
/// Wait for the second answer after [`Outcome::Started`], us: longer than an erase of the flash, and than a
/// re-zero at the longest servo period.
const STARTED_US: u64 = 6_000_000;
/// How often a request is sent: for 3 s, longer than a controller takes to start.
const ATTEMPTS: u32 = 30;
/// How often a request is sent with a new tag: a reset of the node, or a challenge that arrives late, makes
/// a nonce void.
const TAGS: u32 = 4;
/// How often a node names a lost word.
const LOST_MAX: u32 = 1_000;
/// The tokens of transfers have this bit, other tokens do not.
const TRANSFER_TOKEN: u8 = 0x80;

/// A bus and a clock.
pub trait Link {
    /// Sends a frame; a frame that finds no place may be lost.
    ///
    /// # Errors
    /// [`UpdateError::Link`] if the bus cannot be used.
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError>;

    /// The next frame of the bus, or `None` at this time.
    ///
    /// # Errors
    /// [`UpdateError::Link`] if the bus cannot be used.
    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError>;

    /// The node that answers.
    fn node(&self) -> NodeNumber {
        NodeNumber::TABLE
    }

    /// Time since some moment, us.
    fn now_us(&self) -> u64;

    /// Whether the user wants to stop.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// A host that sends one request after the other.
#[derive(Debug)]
pub struct Talk<L> {
    /// The bus.
    pub link: L,
    mailbox: Mailbox,
    token: u8,
    /// When the next frame may be sent, us.
    free_us: u64,
    /// Whether the user may stop now.
    pub(super) may_stop: bool,
}

impl<L: Link> Talk<L> {
    /// Before the first request. Programs that run one after the other need different tokens: a node
    /// ignores a request that equals the last one.
    pub fn new(link: L, token: u8) -> Self {
        Self {
            link,
            mailbox: Mailbox::default(),
            token: token & !TRANSFER_TOKEN,
            free_us: 0,
            may_stop: true,
        }
    }

    /// The next token of a transfer.
    pub(super) fn transfer_token(&mut self) -> u8 {
        self.next_token() | TRANSFER_TOKEN
    }

    fn next_token(&mut self) -> u8 {
        self.token = self.token.wrapping_add(1) & !TRANSFER_TOKEN;
        self.token
    }

    /// Outcome and detail of the answer to a request. The request is repeated until the answer comes.
    ///
    /// # Errors
    /// [`UpdateError::NoAnswer`], [`UpdateError::Unexpected`], [`UpdateError::Interrupted`],
    /// [`UpdateError::Link`].
    pub fn exchange(&mut self, request: Request) -> Result<(Outcome, u32), UpdateError> {
        let token = self.next_token();
        self.exchange_under(token, request)
    }

    /// The same under the token of a transfer.
    pub(super) fn exchange_under(
        &mut self,
        token: u8,
        request: Request,
    ) -> Result<(Outcome, u32), UpdateError> {
        let command = Command::new(request, token);
        for _ in 0..ATTEMPTS {
            self.send(&Content::Command(command))?;
            let mut until_us = self.link.now_us() + PATIENCE_US;
            while let Some(content) = self.receive(until_us)? {
                let Content::Answer(answer) = content else {
                    continue;
                };
                if (answer.number, answer.token) != (command.number, token) {
                    continue;
                }
                match answer.outcome {
                    None => return Err(UpdateError::Unexpected { outcome: None }),
                    Some(Outcome::Started) => until_us = self.link.now_us() + STARTED_US,
                    Some(outcome) => return Ok((outcome, answer.detail)),
                }
            }
        }
        Err(UpdateError::NoAnswer)
    }

    /// As [`Talk::exchange`], for a request that a node with a key obeys only with a tag.
    ///
    /// # Errors
    /// As [`Talk::exchange`], and [`UpdateError::NoRandomNumber`].
    pub fn exchange_tagged(
        &mut self,
        key: Option<&Key>,
        request: Request,
    ) -> Result<(Outcome, u32), UpdateError> {
        let token = self.next_token();
        self.exchange_tagged_under(token, key, request)
    }

    /// The same under the token of a transfer.
    pub(super) fn exchange_tagged_under(
        &mut self,
        token: u8,
        key: Option<&Key>,
        request: Request,
    ) -> Result<(Outcome, u32), UpdateError> {
        let Some(key) = key else {
            return self.exchange_under(token, request);
        };
        let command = Command::new(request, token);
        for _ in 0..TAGS {
            let words = self.authorise(key, &command, &[]);
            match words.and_then(|words| self.exchange_words(token, request, &words)) {
                Ok(((Outcome::NotAuthorised, _), _)) | Err(UpdateError::Lossy) => {}
                answer => return answer.map(|(answer, _)| answer),
            }
        }
        Ok((Outcome::NotAuthorised, 0))
    }

    /// The answer to a request that follows these words, and the number of lost words, which are sent again. "Incomplete" if
    /// other words are missing.
    pub(super) fn exchange_words(
        &mut self,
        token: u8,
        request: Request,
        words: &[UpdateData],
    ) -> Result<((Outcome, u32), u32), UpdateError> {
        for lost in 0..LOST_MAX {
            let answer = self.exchange_under(token, request)?;
            let (Outcome::Incomplete, index) = answer else {
                return Ok((answer, lost));
            };
            let Some(word) = words.iter().find(|word| u32::from(word.index) == index) else {
                return Ok((answer, lost));
            };
            self.send_word(*word)?;
        }
        Err(UpdateError::Lossy)
    }

    /// Asks for a nonce and sends the tag of a command; `blob` as in [`tag`]. Gives the words of the tag.
    ///
    /// # Errors
    /// As [`Talk::exchange`], and [`UpdateError::NoRandomNumber`], [`UpdateError::Lossy`].
    pub fn authorise(
        &mut self,
        key: &Key,
        command: &Command,
        blob: &[u8],
    ) -> Result<Vec<UpdateData>, UpdateError> {
        let nonce = self.nonce()?;
        let tag = tag(key, self.link.node(), &nonce, command, blob);
        let words = words(command.token, &tag, TAG_INDEX);
        words.iter().try_for_each(|word| self.send_word(*word))?;
        Ok(words)
    }

    fn nonce(&mut self) -> Result<Nonce, UpdateError> {
        let mut nonce = [0; 4];
        for (part, word) in (0..).zip(&mut nonce) {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            *word = match self.exchange(challenge)? {
                (Outcome::Done, drawn) => drawn,
                // The node was reset, or another computer has used the nonce.
                (Outcome::NoTransfer, _) => return Err(UpdateError::Lossy),
                (outcome, detail) => return Err(UpdateError::from_outcome(outcome, detail, false)),
            };
        }
        Ok(nonce)
    }

    /// Sends a word; no answer comes.
    pub(super) fn send_word(&mut self, data: UpdateData) -> Result<(), UpdateError> {
        self.send(&Content::UpdateData(data))
    }

    /// Waits.
    pub(super) fn pause(&mut self, us: u64) -> Result<(), UpdateError> {
        let until_us = self.link.now_us() + us;
        while self.receive(until_us)?.is_some() {}
        Ok(())
    }

    fn send(&mut self, content: &Content) -> Result<(), UpdateError> {
        while self.receive(self.free_us)?.is_some() {}
        self.free_us = self.link.now_us() + SPACING_US;
        let coded = self.mailbox.send(content);
        coded.map_or(Ok(()), |coded| self.link.send(BusFrame::from(coded)))
    }

    /// The content of the next frame until then.
    fn receive(&mut self, until_us: u64) -> Result<Option<Content>, UpdateError> {
        /// How soon Ctrl-C is noticed.
        const WAIT_US: u64 = 50_000;
        loop {
            if self.may_stop && self.link.is_interrupted() {
                return Err(UpdateError::Interrupted);
            }
            let now_us = self.link.now_us();
            if now_us >= until_us {
                return Ok(None);
            }
            if let Some(frame) = self.link.receive(until_us.min(now_us + WAIT_US))?
                && let Some(Ok(content)) = self.mailbox.take(&frame)
            {
                return Ok(Some(content));
            }
        }
    }
}

/// The words of `bytes`; the first has the index `first`.
pub(super) fn words(token: u8, bytes: &[u8], first: u8) -> Vec<UpdateData> {
    let words = (0..).map_while(|k| {
        let (index, word) = (first.checked_add(k)?, word_at(bytes, k.into())?);
        Some(UpdateData { token, index, word })
    });
    words.collect()
}

/// The request for a fact of the node.
pub(super) const fn page(page: u8) -> Request {
    Request::Update(UpdateRequest::Tell { page })
}
